"""Where the starts lead, roughly: all are improved side by side, long flights on a coarse copy."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.maximize import feasible, maximize_all
from faao_mav.optimizer.interior.rewards import Stage, StageValues
from faao_mav.optimizer.kinematics import Kinematics, Trajectory

SLOTS = 60
"""Slots of the coarse copy: enough for a route's shape."""

WORTH_IT = 2 * SLOTS
"""Slots from which the coarse copy is cheaper than what it saves."""

_COARSE = 3e-3
"""Tolerance on the copy: that of the flight itself would be wasted on it."""

_HOPEFUL = 5e-3
"""Share of the best value by which a coarse value may be off."""

_SAME = 0.02
"""Flights that stay this close, in shares of the longer extent, are one."""


@dataclass(frozen=True, slots=True)
class Blocks:
    """A stage for `slots` positions, each of which stands for a block of the slots of `stage`.

    (1 / slots) sum_m F_m is then the mean of `stage` over its own slots with w_n = w_m(n): every
    draw of the fading counts.
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
class Rough:
    """Flights near the local optima that the starts lead to, and those of them to go on with."""

    flights: dict[str, Trajectory]
    hopeful: list[str]


def improved(
    kin: Kinematics,
    stage: Stage,
    routes: Mapping[str, Trajectory],
    *,
    tolerance: float,
    max_iterations: int,
) -> Rough:
    """Improve the feasible `routes` to `tolerance`.

    Without hope are flights that end clearly below the best, and those that end where a better
    one does. Short flights, those with a least speed, whose turns a coarse copy cannot make, and
    a single start, which has nothing to be compared with, are improved as they are.
    """
    copy, reward, on_copy = kin, stage, list(routes.values())
    if len(routes) > 1 and kin.slots >= WORTH_IT and kin.min_speed == 0:
        copy, reward = _coarse(kin), Blocks(stage, kin.slots, SLOTS)
        tolerance = max(tolerance, _COARSE)
        on_copy = [copy.follow(_resampled(kin, flight, copy)) for flight in on_copy]
    solved = maximize_all(copy, reward, on_copy, tolerance=tolerance, max_iterations=max_iterations)
    found = dict(zip(routes, solved, strict=True))
    ranked = sorted(found, key=lambda name: -found[name].value)
    least = found[ranked[0]].value * (1 - (0.0 if copy is kin else _HOPEFUL))
    hopeful: list[str] = []
    for name in ranked:
        w = found[name].trajectory.w
        near = _SAME * float(np.ptp(w, axis=0).max())
        others = (found[other].trajectory.w for other in hopeful)
        if found[name].value >= least and all(np.abs(w - other).max() > near for other in others):
            hopeful.append(name)
    flights = {name: optimum.trajectory for name, optimum in found.items()}
    if copy is not kin:
        flights = {
            name: feasible(kin, routes[name], _resampled(copy, flight, kin))
            for name, flight in flights.items()
        }
    return Rough(flights, hopeful)


def _coarse(kin: Kinematics) -> Kinematics:
    """The same flight in `SLOTS` slots.

    Where a(0) has no bound, v(0) says nothing about v(1): on the copy, whose first slot stands for
    several, v(0) is free and a(0) bounded.
    """
    duration = kin.time_step * (kin.slots - 1)
    return replace(
        kin,
        slots=SLOTS,
        time_step=duration / (SLOTS - 1),
        start_velocity=kin.start_velocity if kin.bound_first_acceleration else None,
        bound_first_acceleration=True,
    )


def _resampled(kin: Kinematics, flight: Trajectory, other: Kinematics) -> Real:
    """Return the velocities (slots of `other`, 2) of `flight`, which is one of `kin`."""
    now, then = (k.time_step * np.arange(k.slots) for k in (kin, other))
    found = np.stack([np.interp(then, now, v) for v in flight.v.T], axis=1)
    if other.start_velocity is not None:
        found[0] = other.start_velocity
    elif kin.start_velocity is not None:
        found[0] = flight.v[1]
    return found
