"""Items that PX4 accepts and then flies in a way that nobody expects."""

import math
from collections.abc import Iterator

from faao_mav.mission.command import FLOWN_TO, Command, Frame
from faao_mav.validate.context import NAV_LAST, ValidationContext, at_zero, number
from faao_mav.validate.finding import Level
from faao_mav.validate.rule import Issue, Rules
from faao_mav.vehicle import PX4_COPTER

RULES = Rules(PX4_COPTER.family)

_ROI = (80, Command.DO_SET_ROI)
_ROI_WITH_PLACE, _ROI_WITHOUT_PLACE = (0, 3), (0, 1, 2)

_MEASURED = "measured on PX4 1.16.1"

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


@RULES.warning(
    "px4-stops",
    "an item without autocontinue: PX4 stops the mission there",
    "PX4 1.16 MissionBase::on_active; measured",
)
def _stops(context: ValidationContext) -> Iterator[Issue]:
    for index, item in enumerate(context.items[:-1]):
        if not item.autocontinue:
            yield Issue(
                index,
                "autocontinue is off: PX4 does not go on to the next item",
                "set autocontinue, the last field of the row",
            )


@RULES.error(
    "jump-in-place",
    "a DO_JUMP goes back to an item that does not fly, with none between that does",
    "measured on PX4 1.16.1: it stays on the ground, armed, and its processor is busy",
)
def _jump_in_place(context: ValidationContext) -> Iterator[Issue]:
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


@RULES.error(
    "px4-nothing-to-fly",
    "no item flies: PX4 says that the mission is finished, on the ground",
    _MEASURED,
)
def _nothing(context: ValidationContext) -> Iterator[Issue]:
    if context.items and not any(context.each(*FLOWN_TO)):
        yield Issue(
            None,
            "no item flies to a place: PX4 ends the mission at once, where it stands",
            "add a take-off and waypoints",
        )


@RULES.note(
    "px4-takeoff-elsewhere",
    "a take-off item away from home: PX4 climbs first and then flies there",
    _MEASURED,
    kind="copter",
)
def _takeoff_elsewhere(context: ValidationContext) -> Iterator[Issue]:
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


@RULES.error(
    "px4-roi",
    "PX4 refuses this kind of region of interest (INVALID_PARAM1)",
    "PX4 1.16 MavlinkMissionManager::parse_mavlink_mission_item",
)
def _roi(context: ValidationContext) -> Iterator[Issue]:
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


@RULES.warning(
    "px4-fence-size",
    "more fence vertices or rally points than small PX4 boards store",
    "PX4: 64 fence vertices and 8 rally points on the smallest boards",
)
def _fence_size(context: ValidationContext) -> Iterator[Issue]:
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
