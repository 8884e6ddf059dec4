"""Where items are: their heights, circles, and where a return goes when there are rally points."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot.parameter import ParameterValues
from faao_mav.mission.command import ABOVE_SEA, Command, Frame
from faao_mav.mission.item import Mission, MissionItem


@dataclass(frozen=True, slots=True)
class Orbit:
    """A circle about the place of an item: `radius`, m, and the greatest `turn_rate`, rad/s.

    It is flown for so many `turns`, or for so many `seconds`; if it `climbs` until it is at its
    height, and if it is `endless` for good. `clockwise` as seen from above.
    """

    radius: float
    clockwise: bool
    turns: float = 0.0
    seconds: float = 0.0
    climbs: bool = False
    endless: bool = False
    turn_rate: float = math.inf

    def speed(self, commanded: float) -> float:
        """Return the speed along the circle, m/s, where `commanded` is flown on straights."""
        return min(commanded, self.turn_rate * self.radius)

    def lasting(self, commanded: float, climb: float = 0.0) -> float:
        """Return how long it is flown, s; `climb` is how long the change of height takes, s.

        Of an endless one it is one turn.
        """
        around = 2 * math.pi * self.radius / self.speed(commanded)
        turns = max(self.turns, 1.0) if self.endless else self.turns
        return max(turns * around, self.seconds, climb)

    def edge(self, center: Real, towards: Real) -> Real:
        """Return the place of the circle about `center` (2,) that is nearest to `towards` (2,)."""
        away = towards - center
        distance = float(np.hypot(*away))
        direction = away / distance if distance > 0 else np.array([0.0, 1.0])
        return np.asarray(center + self.radius * direction)

    def outline(self, center: Real, corners: int = 72) -> Real:
        """Return a closed polygon (corners + 1, 2) around the circle about `center` (2,), m."""
        angle = np.linspace(0.0, 2 * np.pi, corners + 1)
        wide = self.radius / math.cos(np.pi / corners)
        return center + wide * np.stack([np.sin(angle), np.cos(angle)], axis=1)


CIRCLING = MissionItem(Command.NAV_LOITER_UNLIM, Frame.GLOBAL_RELATIVE_ALT)
"""How a vehicle goes on that circles where its mission or its return ends."""


def orbit_at(vehicle: ParameterValues, item: MissionItem) -> Orbit | None:
    """Return how `item` is circled at, None where it is not.

    The radius is the item's, param3 or of a LOITER_TO_ALT param2, and without one the vehicle's
    `loiter_radius`; negative ones turn left.
    """
    own = item.params[1 if item.command == Command.NAV_LOITER_TO_ALT else 2]
    given = own if math.isfinite(own) and own != 0 else vehicle.value("loiter_radius")
    number = item.params[0] if math.isfinite(item.params[0]) else 0.0
    radius, clockwise = abs(given), given > 0
    match item.command:
        case Command.NAV_LOITER_TURNS:
            return Orbit(radius, clockwise, turns=max(number, 0.0))
        case Command.NAV_LOITER_TIME:
            return Orbit(radius, clockwise, seconds=max(number, 0.0))
        case Command.NAV_LOITER_TO_ALT:
            return Orbit(radius, clockwise, climbs=True)
        case Command.NAV_LOITER_UNLIM:
            return Orbit(radius, clockwise, endless=True)
    return None


class RallyRule(NamedTuple):
    """Where a return goes: to the nearest rally point within `limit`, m, else home.

    With `home` that is one of the places to choose from, the nearest of which is it.
    """

    limit: float = math.inf
    home: bool = True


def height_above_home(item: MissionItem, mission: Mission) -> float:
    """Return the height of `item` above home, m; NaN where that needs home's and it is not told.

    Heights above terrain count as if the ground were as high as home.
    """
    if item.frame not in ABOVE_SEA and item.frame != Frame.MISSION:
        return item.z
    return item.z - mission.home.altitude if mission.home is not None else math.nan
