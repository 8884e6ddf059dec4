"""Which starts are worth solving: all are tried on a coarse copy of the flight first."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.faao.interior import Stage, StageValues, maximize
from faao_mav.faao.kinematics import Kinematics
from faao_mav.faao.routes import starts

SLOTS = 80
"""Slots of the coarse copy: enough for a route's shape."""

WORTH_IT = 4 * SLOTS
"""Slots from which the coarse copy is cheaper than what it saves."""

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
        """Return values (J, slots), gradients and Hessians at positions w (slots, 2)."""
        block = np.rint(np.linspace(0, self.slots - 1, self.fine)).astype(int)
        first = np.searchsorted(block, np.arange(self.slots))
        at = self.stage(w[block])
        share = self.slots / self.fine
        return StageValues(
            *(
                np.add.reduceat(part, first, axis=1) * share
                for part in (at.value, at.gradient, at.hessian)
            )
        )


def rejected(
    kin: Kinematics,
    stage: Stage,
    names: Sequence[str],
    stations: dict[str, Real],
    *,
    tolerance: float,
    max_iterations: int,
) -> dict[str, float]:
    """Return the starts of `names` that need not be solved, with their coarse min_j F_j.

    On a copy of the flight with `SLOTS` slots, those are the starts that end clearly below the
    best, and those that end where a better one does. The best is never among them. Short
    flights, and those with a least speed, whose turns a coarse copy cannot make, keep all.
    """
    if kin.slots < WORTH_IT or kin.min_speed > 0:
        return {}
    duration = kin.time_step * (kin.slots - 1)
    coarse = replace(kin, slots=SLOTS, time_step=duration / (SLOTS - 1))
    blocks = Blocks(stage, kin.slots, SLOTS)
    found = {
        name: maximize(coarse, blocks, flight, tolerance=tolerance, max_iterations=max_iterations)
        for name, flight in starts(coarse, names, stations).items()
    }
    ranked = sorted(found, key=lambda name: -found[name].value)
    least = found[ranked[0]].value * (1 - _HOPEFUL)
    kept: list[Real] = []
    dropped = {}
    for name in ranked:
        w = found[name].trajectory.w
        near = _SAME * float(np.ptp(w, axis=0).max())
        if found[name].value < least or any(np.abs(w - other).max() <= near for other in kept):
            dropped[name] = found[name].value
        else:
            kept.append(w)
    return dropped
