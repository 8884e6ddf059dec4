"""Improve all starts roughly, side by side, and choose those to improve to the end.

Long flights are improved on a coarse copy with fewer slots, which costs a fraction of the time.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.constraint import Constraint
from faao_mav.optimizer.interior.maximize import constraints_of, feasible, maximize
from faao_mav.optimizer.interior.rewards import Stage, StageValues
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.radio.relay import RelayQueue

COARSE_SLOTS = 60
"""Slots of the coarse copy: enough for the shape of a route. Chosen."""

FEWEST_SLOTS = 2 * COARSE_SLOTS
"""Slots from which a coarse copy is used. Chosen; what a change costs is not measured."""

_COARSE_TOLERANCE = 3e-3  # least tolerance on the copy, which differs from the flight by more
_COARSE_ERROR = 5e-3  # share of the best value within which starts are equally good on the copy
_SAME = 0.02  # distance of flights that count as one, in the longer of their extents in x and y

EQUAL = 1e-6
"""The difference of values, bit/s/Hz, below which flights are equally good: which of two is larger
is then up to rounding, and differs from machine to machine. Chosen."""


@dataclass(frozen=True, slots=True)
class BlockStage:
    """The rewards of `slots` positions, each of which stands for a block of the slots of `stage`.

    (1 / slots) sum_m F_m is the mean of `stage` over its `fine` slots with w_n = w_m(n), so that
    every draw of the fading counts.
    """

    stage: Stage
    fine: int
    slots: int

    def __call__(self, w: Real) -> StageValues:
        """Return values (J, ..., slots), gradients and Hessians at positions w (2, ..., slots)."""
        block = np.rint(np.linspace(0, self.slots - 1, self.fine)).astype(int)
        first = np.searchsorted(block, np.arange(self.slots))
        at = self.stage(w[..., block])
        share = self.slots / self.fine
        return StageValues(
            *(
                np.add.reduceat(part, first, axis=-1) * share
                for part in (at.value, at.gradient, at.hessian)
            )
        )


@dataclass(frozen=True, slots=True)
class ImprovedStarts:
    """The flights near the local optima that the starts lead to, by the name of the start.

    `promising` names those that may be improved to the best local optimum, in the order given.
    """

    flights: dict[str, Trajectory]
    promising: list[str]


def improve_starts(
    kin: Kinematics,
    stage: Stage,
    flights: Mapping[str, Trajectory],
    *,
    tolerance: float,
    max_iterations: int,
    relay: RelayQueue | None = None,
    constraints: Callable[[Kinematics], Sequence[Constraint]] = lambda _: (),
    coarse: bool = True,
) -> ImprovedStarts:
    """Improve the feasible `flights` to `tolerance` and compare them.

    Not promising are flights that end clearly below the best, and those that end where an earlier
    one does. No coarse copy is used for short flights, for those with a least speed (the copy
    cannot make their turns), and for a single start, which needs no comparison.

    The `tolerance` on a coarse copy is at least 3e-3; `relay` is the queue whose delivered rate is
    maximised, if any; `constraints` says what flights of given kinematics keep beside their limits.
    """
    copy, reward, on_copy = kin, stage, list(flights.values())
    if coarse and len(flights) > 1 and kin.slots >= FEWEST_SLOTS and kin.min_speed == 0:
        copy, reward = coarse_copy(kin), BlockStage(stage, kin.slots, COARSE_SLOTS)
        tolerance = max(tolerance, _COARSE_TOLERANCE)
        on_copy = [copy.follow(resampled(kin, flight, copy)) for flight in on_copy]
    kept = constraints(copy)
    optima = {
        name: maximize(
            copy,
            reward,
            start,
            constraints=kept,
            tolerance=tolerance,
            max_iterations=max_iterations,
            relay=relay,
        )
        for name, start in zip(flights, on_copy, strict=True)
    }
    best = max(optimum.value for optimum in optima.values())
    least = best - max(EQUAL, 0.0 if copy is kin else _COARSE_ERROR * best)
    promising: list[str] = []
    for name in optima:  # of flights that count as one the first: values hang on rounding
        w = optima[name].trajectory.w
        near = _SAME * float(np.ptp(w, axis=0).max())
        others = (optima[other].trajectory.w for other in promising)
        if optima[name].value >= least and all(np.abs(w - other).max() > near for other in others):
            promising.append(name)
    ends = {name: optimum.trajectory for name, optimum in optima.items()}
    if copy is not kin:
        kept = (*constraints_of(kin), *constraints(kin))
        ends = {
            name: feasible(kin, flights[name], resampled(copy, end, kin), kept)
            for name, end in ends.items()
        }
    return ImprovedStarts(ends, promising)


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


def resampled(kin: Kinematics, flight: Trajectory, other: Kinematics) -> Real:
    """Return the velocities of `flight`, one of `kin`, at the slots of `other`, (slots, 2)."""
    now, then = (k.time_step * np.arange(k.slots) for k in (kin, other))
    velocities = np.stack([np.interp(then, now, v) for v in flight.v.T], axis=1)
    if other.start_velocity is not None:
        velocities[0] = other.start_velocity
    elif kin.start_velocity is not None:
        velocities[0] = flight.v[1]
    return velocities


def stretched(kin: Kinematics, flight: Trajectory) -> Real:
    """Return the velocities (slots, 2) at which the path of `flight` takes the time of `kin`.

    The longer it takes the less speed and acceleration it needs. With velocities of the ends that
    are zero or free, and in calm air, the rates along it have nearly the same means.
    """
    share = np.linspace(0, 1, len(flight.v))
    faster = (len(flight.v) - 1) / (kin.slots - 1)
    at = np.linspace(0, 1, kin.slots)
    velocities = faster * np.stack([np.interp(at, share, v) for v in flight.v.T], axis=1)
    for n, given in ((0, kin.start_velocity), (-1, kin.end_velocity)):
        if given is not None:
            velocities[n] = given
    return velocities
