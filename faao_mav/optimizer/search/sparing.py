"""Starts that keep a limit on the energy.

Rotors take the least power some way above hover, so that an aircraft which is to wait sparingly
circles. A hover is no start from which that is found: P is stationary at v = 0.
"""

from collections.abc import Mapping, Sequence
from itertools import cycle

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.constraint import Constraint
from faao_mav.optimizer.interior.energy import EnergyLimit
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.search.track import ALLOWED, nearest_flight

_TURN_SHARE = 0.7
"""Share of the largest acceleration that circles of a start take; the rest is for the way. Chosen.
"""

_SPEEDS = 200
"""Speeds up to v_max among which that of least power is looked for. Chosen."""


def sparing_starts(
    kin: Kinematics, routes: Mapping[str, Trajectory], kept: Sequence[Constraint]
) -> dict[str, Trajectory]:
    """Return flights near to `routes` that keep the energy limit among `kept`; some may be none.

    A route that takes too much is led round in circles of the speed of least power, one to the left
    and the next to the right: which is better depends on what is before and after.
    """
    (limit,) = (each for each in kept if isinstance(each, EnergyLimit))
    found = {}
    for side, (name, route) in zip(cycle((1, -1)), routes.items(), strict=False):
        if max(each.excess(kin, route) for each in kept) <= ALLOWED:
            found[name] = route
            continue
        near = nearest_flight(kin, _circled(kin, route, limit, side), route, kept)
        if near is not None:
            found[name] = near
    return found


def _circled(kin: Kinematics, route: Trajectory, limit: EnergyLimit, side: int) -> Real:
    """Return the path (n, 2) of `route` with circles about it, to the left where `side` is 1."""
    speed, _ = limit.model.least_power(np.linspace(kin.max_speed / _SPEEDS, kin.max_speed, _SPEEDS))
    per_second = _TURN_SHARE * kin.turning(speed) / speed
    angle = side * per_second * kin.time_step * np.arange(kin.slots)
    return route.w + speed / per_second * np.stack([np.cos(angle), np.sin(angle)], axis=1)
