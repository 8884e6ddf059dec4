"""Items and acceptance radii that PX4 accepts and then flies in a way that nobody expects."""

import math
from collections.abc import Iterator
from itertools import pairwise

from faao_mav.mission.command import FLOWN_TO, Command, Frame
from faao_mav.validate.context import NAV_LAST, ValidationContext, at_zero
from faao_mav.validate.rule import Issue, Rules
from faao_mav.validate.straight import HOME, Straight

RULES = Rules("px4")

_ROI = (80, Command.DO_SET_ROI)
_ROI_WITH_PLACE, _ROI_WITHOUT_PLACE = (0, 3), (0, 1, 2)

_MEASURED = "measured on PX4 1.16.1"

SMALLEST = 1.0
"""The radius, m, below which an aircraft may miss it. Measured: it is off by up to 0.5 m."""

_NARROWER = 0.5
"""How much smaller, m, the next radius may be: the aircraft flies on that far while it switches."""

_STRAIGHT = math.radians(5)
"""The turn up to which the way back to a waypoint is no detour, rad. Chosen."""

RULES.error_where(
    "px4-null-island",
    "latitude and longitude are 0: PX4 flies there, to the Gulf of Guinea",
    "give the coordinates; for a take-off those of home",
    _MEASURED,
    lambda context: (
        k for k, item in context.each(*FLOWN_TO) if at_zero(item) and item.frame != Frame.MISSION
    ),
)
RULES.error_where(
    "px4-altitude-missing",
    "the altitude is not set (NaN): PX4 accepts it and then hovers there for good",
    "give the altitude",
    _MEASURED,
    lambda context: (k for k, item in context.each(*FLOWN_TO) if math.isnan(item.z)),
)
RULES.warning_where(
    "px4-stops",
    "autocontinue is off: PX4 does not go on to the next item",
    "set autocontinue, the last field of the row",
    "PX4 1.16 MissionBase::on_active; measured",
    lambda context: (k for k, item in enumerate(context.items[:-1]) if not item.autocontinue),
)


@RULES.error(
    "jump-in-place",
    "measured on PX4 1.16.1: it stays on the ground, armed, and its processor is busy",
    "jump to a waypoint, or remove the jump",
)
def _jump_in_place(context: ValidationContext) -> Iterator[Issue]:
    """A DO_JUMP goes back over items that do not fly: PX4 does not take off."""
    for index, item, target in context.jumps:
        # A jump to itself is flown.
        if item.command != Command.DO_JUMP or item.params[1] == 0 or not (target or 0) < index:
            continue
        if all(each.command > NAV_LAST for each in context.items[target:index]):
            yield Issue(index)


@RULES.error("px4-nothing-to-fly", _MEASURED, "add a take-off and waypoints")
def _nothing(context: ValidationContext) -> Iterator[Issue]:
    """No item flies to a place: PX4 ends the mission at once, on the ground."""
    if context.items and not any(context.each(*FLOWN_TO)):
        yield Issue()


@RULES.note("px4-takeoff-elsewhere", _MEASURED, "nothing, if the way is free", kind="copter")
def _takeoff_elsewhere(context: ValidationContext) -> Iterator[Issue]:
    """A take-off item away from home: PX4 climbs first and then flies there."""
    radius = context.vehicle.value("acceptance_radius")
    for place in context.places_of({Command.NAV_TAKEOFF}) if context.home is not None else ():
        if place.from_origin > radius:
            told = f"the take-off item is {place.from_origin:.0f} m from home: PX4 climbs first"
            yield Issue(place.index, f"{told} and then flies there")


@RULES.error(
    "px4-roi",
    "PX4 1.16 MavlinkMissionManager::parse_mavlink_mission_item",
    "use DO_SET_ROI_LOCATION (195) or DO_SET_ROI_NONE (197)",
)
def _roi(context: ValidationContext) -> Iterator[Issue]:
    """PX4 refuses this kind of region of interest (INVALID_PARAM1)."""
    for index, item in context.each(*_ROI):
        allowed = _ROI_WITHOUT_PLACE if item.frame == Frame.MISSION else _ROI_WITH_PLACE
        mode = item.params[0]
        if math.isnan(mode) or math.trunc(mode) not in allowed:
            told = f"region of interest {mode:g} in frame {item.frame}; PX4 takes "
            yield Issue(index, told + ", ".join(map(str, allowed)))


@RULES.warning(
    "px4-fence-size",
    "PX4: 64 fence vertices and 8 rally points on the smallest boards",
    "use fewer, or check that your board stores them",
)
def _fence_size(context: ValidationContext) -> Iterator[Issue]:
    """More fence vertices or rally points than small PX4 boards store."""
    fence, dialect = context.mission.fence, context.vehicle.type.dialect
    vertices = sum(len(polygon.vertices) for polygon in fence.polygons) + len(fence.circles)
    for count, limit, what in (
        (vertices, dialect.fence_rows, "fence vertices"),
        (len(context.mission.rally), dialect.rally_rows, "rally points"),
    ):
        if count > limit:
            yield Issue(None, f"{count} {what}; the smallest boards store {limit}")


def _radii(context: ValidationContext) -> Iterator[tuple[Straight, float]]:
    """Yield each leg to a waypoint, with the acceptance radius there, m."""
    default = context.vehicle.value("acceptance_radius")
    for leg in context.legs:
        item = context.items[leg.index]
        if item.command == Command.NAV_WAYPOINT and not leg.jump:
            yield leg, item.params[1] if item.params[1] > 0 else default


@RULES.warning(
    "px4-radius-covers-leg",
    _MEASURED,
    "use a smaller radius (param2, NAV_ACC_RAD) or a longer leg",
)
def _covers(context: ValidationContext) -> Iterator[Issue]:
    """An acceptance radius as long as its leg: the waypoint counts as reached at once."""
    for leg, radius in _radii(context):
        held = context.items[leg.index].params[0] > 0  # it is held at all the same
        if leg.start.index != HOME and 0.05 <= leg.length <= radius and not held:
            told = f"the leg is {leg.length:.1f} m long, the acceptance radius {radius:g} m"
            yield Issue(leg.index, f"{told}: the waypoint counts as reached at once")


RULES.warning_where(
    "px4-radius-small",
    "an acceptance radius that the aircraft may miss for minutes",
    f"use {SMALLEST:g} m or more (param2, NAV_ACC_RAD)",
    f"{_MEASURED}: 0.05 m held it for 53 s, 0.1 m for 124 s, 0.3 m for 6 s",
    lambda context: ((leg.index, r) for leg, r in _radii(context) if r < SMALLEST),
    "an acceptance radius of {:g} m: the aircraft may wait there for minutes",
    kind="copter",
)


@RULES.warning("px4-radius-narrows", f"{_MEASURED}; PX4 1.16 FlightTaskAuto", kind="copter")
def _narrows(context: ValidationContext) -> Iterator[Issue]:
    """A radius wider than the next in a corner: the aircraft first flies back to the waypoint."""
    for (leg, radius), (onward, smaller) in pairwise(_radii(context)):
        if leg.end is not onward.start or context.items[leg.index].params[0] > 0:
            continue
        if radius > smaller + _NARROWER and leg.turn(onward) > _STRAIGHT:
            told = f"a radius of {radius:g} m here and {smaller:g} m at item {onward.index + 1}: "
            do = f"use the same radius for both, {smaller:g} m here or {radius:g} m there"
            yield Issue(leg.index, told + "the aircraft slows down and flies to the waypoint", do)
