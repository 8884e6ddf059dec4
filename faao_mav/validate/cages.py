"""The bounds about home that an autopilot's parameters draw, beside any fence of the mission."""

from collections.abc import Iterator
from dataclasses import dataclass

from faao_mav.autopilot import ARDUCOPTER, PX4_COPTER
from faao_mav.mission.command import Command
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.rule import Issue, Level, Rule

_ARDUPILOT, _PX4 = ARDUCOPTER.family, PX4_COPTER.family


@dataclass(frozen=True, slots=True)
class _Cage:
    """A bound that the parameter of the table with this key sets, m; no place may be beyond it.

    `bit` is that of FENCE_TYPE which switches it on together with FENCE_ENABLE; without one it is
    on above 0. `distance`: it bounds the distance from home, else the height above it; `floor`: it
    bounds from below.
    """

    key: str
    bit: int = 0
    distance: bool = False
    floor: bool = False

    def check(self, context: ValidationContext) -> Iterator[Issue]:
        """Yield the items beyond the bound."""
        limit = context.vehicle.value(self.key)
        name = context.vehicle.type.parameters[self.key].newest_name
        if not self._is_on(context, limit) or (self.distance and context.home is None):
            return
        for place in context.places:
            value = place.from_origin if self.distance else place.up
            lands = context.items[place.index].command == Command.NAV_LAND
            if (value < limit and not lands) if self.floor else value > limit:
                shown = f"{value:.0f} m from home" if self.distance else f"{value:g} m above home"
                verb = "move" if self.distance else "raise" if self.floor else "lower"
                yield Issue(
                    place.index,
                    f"{shown}; {name} is {limit:g} m",
                    f"{verb} the item, or change {name}",
                )

    def _is_on(self, context: ValidationContext, limit: float) -> bool:
        if not self.bit:
            return limit > 0
        switched_on = context.vehicle.value("fence_enable") != 0
        return switched_on and bool(int(context.vehicle.value("fence_type")) & self.bit)


_GEOFENCE = "PX4 1.16 Geofence::check, MissionFeasibilityChecker::checkGeofence"

RULES = [
    Rule(
        "ardupilot-fence-ceiling",
        Level.ERROR,
        "the mission climbs above FENCE_ALT_MAX while the fence is on",
        "ArduPilot 4.7 AC_Fence::check_fence_alt_max; measured",
        _Cage("fence_ceiling", bit=1).check,
        _ARDUPILOT,
    ),
    Rule(
        "ardupilot-fence-floor",
        Level.ERROR,
        "the mission descends below FENCE_ALT_MIN while the fence is on",
        "ArduPilot 4.7 AC_Fence::check_fence_alt_min",
        _Cage("fence_floor", bit=8, floor=True).check,
        _ARDUPILOT,
    ),
    Rule(
        "ardupilot-fence-circle",
        Level.ERROR,
        "the mission goes beyond FENCE_RADIUS from home while the fence is on",
        "ArduPilot 4.7 AC_Fence::check_fence_circle; measured",
        _Cage("fence_radius", bit=2, distance=True).check,
        _ARDUPILOT,
    ),
    Rule(
        "px4-max-horizontal",
        Level.ERROR,
        "farther from home than GF_MAX_HOR_DIST",
        _GEOFENCE,
        _Cage("fence_distance", distance=True).check,
        _PX4,
    ),
    Rule(
        "px4-max-vertical",
        Level.ERROR,
        "higher above home than GF_MAX_VER_DIST",
        _GEOFENCE,
        _Cage("fence_height").check,
        _PX4,
    ),
]
