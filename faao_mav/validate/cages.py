"""The bounds about home that an autopilot's parameters draw, beside any fence of the mission."""

from collections.abc import Iterator
from dataclasses import dataclass

from faao_mav.mission.command import Command
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.rule import Issue, Level, Rule


@dataclass(frozen=True, slots=True)
class _Cage:
    """A bound that the parameter with this key, `name` to people, sets, m; no place is beyond it.

    `bit` is that of FENCE_TYPE which switches it on together with FENCE_ENABLE; without one it is
    on above 0. `distance`: it bounds the distance from home, else the height above it; `floor`: it
    bounds from below.
    """

    key: str
    name: str
    source: str
    bit: int = 0
    distance: bool = False
    floor: bool = False

    def check(self, context: ValidationContext) -> Iterator[Issue]:
        """Yield the items beyond the bound."""
        value = context.vehicle.value
        limit, on = value(self.key), value(self.key) > 0
        if self.bit:
            on = value("fence_enable") != 0 and bool(int(value("fence_type")) & self.bit)
        if not on or (self.distance and context.home is None):
            return
        for place in context.places:
            far = place.from_origin if self.distance else place.up
            lands = context.items[place.index].command == Command.NAV_LAND
            if (far < limit and not lands) if self.floor else far > limit:
                shown = f"{far:.0f} m from home" if self.distance else f"{far:g} m above home"
                told = f"{shown}; {self.name} is {limit:g} m"
                yield Issue(place.index, told, f"move the item, or change {self.name}")


_AC_FENCE = "ArduPilot 4.7 AC_Fence; measured"
_GEOFENCE = "PX4 1.16 Geofence::check, MissionFeasibilityChecker::checkGeofence"

_CAGES = {
    "ardupilot-fence-ceiling": _Cage("fence_ceiling", "FENCE_ALT_MAX", _AC_FENCE, bit=1),
    "ardupilot-fence-floor": _Cage("fence_floor", "FENCE_ALT_MIN", _AC_FENCE, bit=8, floor=True),
    "ardupilot-fence-circle": _Cage("fence_radius", "FENCE_RADIUS", _AC_FENCE, 2, distance=True),
    "px4-max-horizontal": _Cage("fence_distance", "GF_MAX_HOR_DIST", _GEOFENCE, distance=True),
    "px4-max-vertical": _Cage("fence_height", "GF_MAX_VER_DIST", _GEOFENCE),
}

RULES = [
    Rule(
        name,
        Level.ERROR,
        f"an item beyond {cage.name}{' while the fence is on' if cage.bit else ''}",
        "",
        cage.source,
        cage.check,
        name.partition("-")[0],
    )
    for name, cage in _CAGES.items()
]
