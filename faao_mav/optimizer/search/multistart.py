"""Improve all starts roughly, side by side, and choose those to improve to the end.

Long flights are improved on a coarse copy with fewer slots, which costs a fraction of the time.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.maximize import constraints_of, feasible, maximize
from faao_mav.optimizer.interior.rewards import Stage, StageValues
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.problem import Problem

COARSE_SLOTS = 60
"""Slots of the coarse copy: enough for the shape of a route. Chosen."""

FEWEST_SLOTS = 2 * COARSE_SLOTS
"""Slots from which a coarse copy is used. Chosen; what a change costs is not measured."""

ROUGH, _COARSE_TOLERANCE = 1e-3, 3e-3
"""The tolerances on R_avg, bit/s/Hz, to which starts are improved before they are compared: of the
flights themselves, and on the copy, which differs from them by more. Chosen."""

_COARSE_ERROR = 5e-3
"""The share of the best value within which starts are equally good on the copy. Chosen."""

_SAME = 0.02
"""The distance of flights that count as one, in the longer of their extents in x and y. Chosen."""

EQUAL = 1e-6
"""The difference of values, bit/s/Hz, below which flights are equally good: which of two is larger
is then up to rounding, and differs from machine to machine. Chosen."""


def block_stage(stage: Stage, fine: int, slots: int) -> Stage:
    """Return the rewards of `slots` positions, each standing for a block of the slots of `stage`.

    (1 / slots) sum_m F_m is the mean of `stage` over its `fine` slots with w_n = w_m(n), so that
    every draw of the fading counts.
    """
    block = np.rint(np.linspace(0, slots - 1, fine)).astype(int)
    first = np.searchsorted(block, np.arange(slots))

    def of_blocks(w: Real) -> StageValues:
        at = stage(w[..., block])
        parts = (at.value, at.gradient, at.hessian)
        return StageValues(*(np.add.reduceat(x, first, axis=-1) * slots / fine for x in parts))

    return of_blocks


def improve_starts(
    problem: Problem, stage: Stage, flights: Mapping[str, Trajectory], max_iterations: int
) -> tuple[dict[str, Trajectory], list[str]]:
    """Return the feasible `flights` improved roughly by `stage`, and the names of promising ones.

    Not promising are flights that end clearly below the best, and those that end where an earlier
    one does. No coarse copy is used for short flights, for those with a least speed or an energy
    (the copy cannot make their circles).
    """
    kin = copy = problem.kinematics
    reward, tolerance = stage, ROUGH
    if kin.slots >= FEWEST_SLOTS and kin.min_speed == 0 and problem.energy == np.inf:
        copy, tolerance = coarse_copy(kin), _COARSE_TOLERANCE
        reward = block_stage(stage, kin.slots, COARSE_SLOTS)
    kept, optima = problem.constraints(copy), {}
    for name, flight in flights.items():
        start = flight if copy is kin else copy.follow(paced(copy, flight, kin.time_step))
        optima[name] = maximize(
            copy,
            reward,
            start,
            constraints=kept,
            tolerance=tolerance,
            max_iterations=max_iterations,
            relay=problem.maximised_queue,
        )
    best = max(optimum.value for optimum in optima.values())
    least = best - max(EQUAL, 0.0 if copy is kin else _COARSE_ERROR * best)
    promising: list[str] = []
    for name, optimum in optima.items():  # of flights that count as one the first
        w = optimum.trajectory.w
        near = _SAME * float(np.ptp(w, axis=0).max())
        others = (optima[other].trajectory.w for other in promising)
        if optimum.value >= least and all(np.abs(w - other).max() > near for other in others):
            promising.append(name)
    improved = {name: optimum.trajectory for name, optimum in optima.items()}
    if copy is not kin:
        limits = (*constraints_of(kin), *problem.constraints(kin))
        for name, end in improved.items():
            velocities = paced(kin, end, copy.time_step)
            improved[name] = feasible(kin, flights[name], velocities, limits)
    return improved, promising


def coarse_copy(kin: Kinematics) -> Kinematics:
    """Return the feasible set `kin` in `COARSE_SLOTS` slots.

    Where a(0) has no bound, v(0) does not limit v(1). The first slot of the copy stands for several
    of `kin`: on it v(0) is free and a(0) bounded.
    """
    duration = kin.time_step * (kin.slots - 1)
    return replace(
        kin,
        slots=COARSE_SLOTS,
        time_step=duration / (COARSE_SLOTS - 1),
        start_velocity=kin.start_velocity if kin.bound_first_acceleration else None,
        bound_first_acceleration=True,
    )


def paced(kin: Kinematics, flight: Trajectory, time_step: float) -> Real:
    """Return the velocities (slots, 2) at which the path of `flight` takes the time of `kin`.

    The slots of `flight` are of `time_step` s. The longer it takes the less speed and acceleration
    it needs. With velocities of the ends that are zero or free, and in calm air, the rates along it
    have nearly the same means.
    """
    faster = time_step * (len(flight.v) - 1) / (kin.time_step * (kin.slots - 1))
    share, at = np.linspace(0, 1, len(flight.v)), np.linspace(0, 1, kin.slots)
    velocities = faster * np.stack([np.interp(at, share, v) for v in flight.v.T], axis=1)
    for n, given in ((0, kin.start_velocity), (-1, kin.end_velocity)):
        if given is not None:
            velocities[n] = given
    return velocities
