"""Items and acceptance radii that PX4 accepts and then flies in a way that nobody expects."""

import math
from collections.abc import Iterator
from itertools import pairwise

from faao_mav.mission.command import FLOWN_TO, Command, Frame
from faao_mav.validate.context import NAV_LAST, ValidationContext, at_zero, number
from faao_mav.validate.rule import Issue, Level, Rules
from faao_mav.validate.straight import HOME, Straight

RULES = Rules("px4")

_ROI = (80, Command.DO_SET_ROI)
_ROI_WITH_PLACE, _ROI_WITHOUT_PLACE = (0, 3), (0, 1, 2)

_MEASURED = "measured on PX4 1.16.1"

_SMALLEST = 1.0
"""The radius, m, below which an aircraft may miss it. Measured: it is off by up to 0.5 m."""

_NARROWER = 0.5
"""How much smaller, m, the next radius may be: the aircraft flies on that far while it switches."""

_STRAIGHT = math.radians(5)
"""The turn up to which the way back to a waypoint is no detour, rad. Chosen."""

RULES.commands(
    Level.ERROR,
    "px4-null-island",
    "an item at latitude and longitude 0: PX4 flies there, to the Gulf of Guinea",
    _MEASURED,
    FLOWN_TO,
    "latitude and longitude are 0: PX4 flies off towards 0, 0, after a take-off as well",
    "give the coordinates; for a take-off those of home",
    where=lambda item: at_zero(item) and item.frame != Frame.MISSION,
)
RULES.commands(
    Level.ERROR,
    "px4-altitude-missing",
    "an altitude that is not set: PX4 hovers at that item for good",
    _MEASURED,
    FLOWN_TO,
    "the altitude is not set (NaN): PX4 accepts it and then hovers there for good",
    "give the altitude",
    where=lambda item: math.isnan(item.z),
)


@RULES.warning("px4-stops", "PX4 1.16 MissionBase::on_active; measured")
def _stops(context: ValidationContext) -> Iterator[Issue]:
    """An item without autocontinue: PX4 stops the mission there."""
    for index, item in enumerate(context.items[:-1]):
        if not item.autocontinue:
            yield Issue(
                index,
                "autocontinue is off: PX4 does not go on to the next item",
                "set autocontinue, the last field of the row",
            )


@RULES.error(
    "jump-in-place",
    "measured on PX4 1.16.1: it stays on the ground, armed, and its processor is busy",
)
def _jump_in_place(context: ValidationContext) -> Iterator[Issue]:
    """A DO_JUMP goes back to an item that does not fly, with none between that does."""
    for index, item in context.each(Command.DO_JUMP):
        target = context.jump_target(index)
        # A jump to itself is flown.
        if target is None or target >= index or item.params[1] == 0:
            continue
        if all(each.command > NAV_LAST for each in context.items[target:index]):
            yield Issue(
                index,
                f"the loop from item {number(target)} to here flies nowhere: PX4 does not take off",
                "jump to a waypoint, or remove the jump",
            )


@RULES.error("px4-nothing-to-fly", _MEASURED)
def _nothing(context: ValidationContext) -> Iterator[Issue]:
    """No item flies: PX4 says that the mission is finished, on the ground."""
    if context.items and not any(context.each(*FLOWN_TO)):
        yield Issue(
            None,
            "no item flies to a place: PX4 ends the mission at once, where it stands",
            "add a take-off and waypoints",
        )


@RULES.note("px4-takeoff-elsewhere", _MEASURED, kind="copter")
def _takeoff_elsewhere(context: ValidationContext) -> Iterator[Issue]:
    """A take-off item away from home: PX4 climbs first and then flies there."""
    if context.home is None:
        return
    radius = context.vehicle.value("acceptance_radius")
    for place in context.places:
        distance = place.from_origin
        if context.items[place.index].command == Command.NAV_TAKEOFF and distance > radius:
            yield Issue(
                place.index,
                f"the take-off item is {distance:.0f} m from home: PX4 climbs at home and then "
                "flies there",
                "nothing, if the way is free",
            )


@RULES.error("px4-roi", "PX4 1.16 MavlinkMissionManager::parse_mavlink_mission_item")
def _roi(context: ValidationContext) -> Iterator[Issue]:
    """PX4 refuses this kind of region of interest (INVALID_PARAM1)."""
    for index, item in context.each(*_ROI):
        allowed = _ROI_WITHOUT_PLACE if item.frame == Frame.MISSION else _ROI_WITH_PLACE
        mode = item.params[0]
        if math.isnan(mode) or math.trunc(mode) not in allowed:
            yield Issue(
                index,
                f"region of interest {mode:g} in frame {item.frame}; PX4 takes "
                f"{', '.join(map(str, allowed))} there",
                "use DO_SET_ROI_LOCATION (195) or DO_SET_ROI_NONE (197)",
            )


@RULES.warning("px4-fence-size", "PX4: 64 fence vertices and 8 rally points on the smallest boards")
def _fence_size(context: ValidationContext) -> Iterator[Issue]:
    """More fence vertices or rally points than small PX4 boards store."""
    fence, dialect = context.mission.fence, context.vehicle.type.dialect
    vertices = sum(len(polygon.vertices) for polygon in fence.polygons) + len(fence.circles)
    for count, limit, what in (
        (vertices, dialect.fence_rows, "fence vertices"),
        (len(context.mission.rally), dialect.rally_rows, "rally points"),
    ):
        if count > limit:
            yield Issue(
                None,
                f"{count} {what}; the smallest boards store {limit}",
                "use fewer, or check that your board stores them",
            )


def _radii(context: ValidationContext) -> Iterator[tuple[Straight, float]]:
    """Yield each leg to a waypoint, with the acceptance radius there, m."""
    default = context.vehicle.value("acceptance_radius")
    for leg in context.legs:
        item = context.items[leg.index]
        if item.command == Command.NAV_WAYPOINT and not leg.jump:
            yield leg, item.params[1] if item.params[1] > 0 else default


@RULES.warning("px4-radius-covers-leg", _MEASURED)
def _covers(context: ValidationContext) -> Iterator[Issue]:
    """An acceptance radius as long as its leg: the waypoint counts at once."""
    for leg, radius in _radii(context):
        held = context.items[leg.index].params[0] > 0  # it is held at all the same
        if leg.start.index != HOME and 0.05 <= leg.length <= radius and not held:
            yield Issue(
                leg.index,
                f"the leg is {leg.length:.1f} m long, the acceptance radius {radius:g} m: the "
                "waypoint counts as reached at once",
                "use a smaller radius (param2, NAV_ACC_RAD) or a longer leg",
            )


@RULES.warning(
    "px4-radius-small",
    f"{_MEASURED}: 0.05 m held it for 53 s, 0.1 m for 124 s, 0.3 m for 6 s",
    kind="copter",
)
def _small(context: ValidationContext) -> Iterator[Issue]:
    """An acceptance radius that the aircraft may miss for minutes."""
    for leg, radius in _radii(context):
        if radius < _SMALLEST:
            yield Issue(
                leg.index,
                f"an acceptance radius of {radius:g} m: the aircraft is seldom that close and may "
                "wait at the waypoint for minutes",
                f"use {_SMALLEST:g} m or more (param2, NAV_ACC_RAD)",
            )


@RULES.warning(
    "px4-radius-narrows",
    f"{_MEASURED}; PX4 1.16 FlightTaskAuto",
    summary="a radius wider than the next one in a corner: the aircraft first flies back to the "
    "waypoint",
    kind="copter",
)
def _narrows(context: ValidationContext) -> Iterator[Issue]:
    for (leg, radius), (onward, smaller) in pairwise(_radii(context)):
        if leg.end is not onward.start or context.items[leg.index].params[0] > 0:
            continue
        if radius > smaller + _NARROWER and leg.turn(onward) > _STRAIGHT:
            yield Issue(
                leg.index,
                f"left {radius:g} m before it for item {number(onward.index)}, whose radius is "
                f"{smaller:g} m: the aircraft slows down and first flies to the waypoint",
                f"use the same radius for both, {smaller:g} m here or {radius:g} m there",
            )
