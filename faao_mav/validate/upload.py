"""What is refused when a mission is uploaded, and what is taken in another way than it looks."""

import math
from collections.abc import Iterator

from faao_mav.mission.command import ABOVE_TERRAIN, FLOWN_TO, Command, Frame
from faao_mav.validate import parameters
from faao_mav.validate.case import LARGEST, Case, fits_message
from faao_mav.validate.finding import Level
from faao_mav.validate.rule import Issue, Rules
from faao_mav.vehicle.dialect import name_of
from faao_mav.vehicle.dialects import accepts, dialect_of

RULES = Rules()

_PARSERS = (
    "ArduPilot 4.7 AP_Mission::mavlink_int_to_mission_cmd, PX4 1.16 "
    "MavlinkMissionManager::parse_mavlink_mission_item; measured"
)
_SIZES = "ArduPilot: 15 bytes an item; PX4: 1000 items on most boards; measured"

_COPTER_SKIPS = (30, 83, 191, 194, 210, 212, 223, 3000)
_PLANE_SKIPS = (Command.CONDITION_YAW, 213, 222, 42600)

_ROI = (80, Command.DO_SET_ROI)
_ROI_WITH_PLACE, _ROI_WITHOUT_PLACE = (0, 3), (0, 1, 2)

_FENCE_VERTICES, _RALLY_POINTS = 64, 8


@RULES.add(
    "refused-on-upload",
    Level.ERROR,
    "the autopilot refuses the item, and the mission with it",
    _PARSERS,
)
def _refused(case: Case) -> Iterator[Issue]:
    for index, item in enumerate(case.items):
        reason = accepts(item, case.vehicle)
        if reason is not None:
            message, _, action = reason.partition("; ")
            if not action:
                action = _replacement(item.command, item.frame)
            yield Issue(index, message, action)


@RULES.add(
    "number-too-large",
    Level.ERROR,
    "a number that a message cannot carry",
    "MAVLink: MISSION_ITEM_INT has numbers of single precision",
)
def _too_large(case: Case) -> Iterator[Issue]:
    for index, item in enumerate(case.items):
        if not fits_message(item):
            largest = max(abs(v) for v in (*item.params, item.z) if not math.isnan(v))
            yield Issue(
                index,
                f"{largest:g} does not fit into a message: numbers are at most {LARGEST:.2g}",
                "correct the number",
            )


def _replacement(command: int, frame: int) -> str:
    if command == Command.NAV_SPLINE_WAYPOINT:
        return "replace it by plain waypoints"
    if command in FLOWN_TO and frame == Frame.MISSION:
        return "set the frame to 3: height above home"
    if command not in FLOWN_TO and frame != Frame.MISSION:
        return "set the frame to 2, or remove the item"
    return "remove the item, or use a command that the autopilot has"


@RULES.add("storage-full", Level.ERROR, "more items than any board of the autopilot stores", _SIZES)
def _full(case: Case) -> Iterator[Issue]:
    rows, most = _rows(case), dialect_of(case.vehicle).items.most
    if rows > most and not _on_card(case):
        yield Issue(
            None,
            f"{rows} items{_with_home(case)}; {case.vehicle.type.name} stores {most} at "
            "most (NO_SPACE)",
            _thin(case),
        )


@RULES.add("storage-tight", Level.WARNING, "more items than common boards store", _SIZES)
def _tight(case: Case) -> Iterator[Issue]:
    rows, limit = _rows(case), dialect_of(case.vehicle).items
    if limit.sure < rows <= limit.most and not _on_card(case):
        yield Issue(
            None,
            f"{rows} items{_with_home(case)}; {limit.sure} are known to fit, boards differ",
            _thin(case),
        )


def _rows(case: Case) -> int:
    return len(case.items) + dialect_of(case.vehicle).home_row


def _with_home(case: Case) -> str:
    return " with home" if dialect_of(case.vehicle).home_row else ""


def _on_card(case: Case) -> bool:
    return case.vehicle.autopilot == "ardupilot" and parameters.SD_STORAGE.of(case.vehicle) > 0


def _thin(case: Case) -> str:
    if case.vehicle.autopilot == "ardupilot":
        return "thin the waypoints, or set BRD_SD_MISSION to store missions on the card"
    return "thin the waypoints"


@RULES.add(
    "many-jumps",
    Level.WARNING,
    "more DO_JUMPs than the autopilot counts the repeats of",
    "ArduPilot 4.7 AP_MISSION_MAX_NUM_DO_JUMP_COMMANDS: 15, on large boards 100",
)
def _many_jumps(case: Case) -> Iterator[Issue]:
    limit = dialect_of(case.vehicle).jumps
    jumps = [index for index, _ in case.each(Command.DO_JUMP)]
    if limit is not None and len(jumps) > limit.sure:
        yield Issue(
            jumps[limit.sure],
            f"this is DO_JUMP number {limit.sure + 1} of {len(jumps)}; boards keep count of "
            f"{limit.sure}, large ones of {limit.most}, and do not jump at the others",
            "write the repeated items out",
        )


@RULES.add(
    "ardupilot-command-skipped",
    Level.WARNING,
    "ArduPilot stores this command, but this kind of aircraft does nothing with it",
    "ArduCopter 4.7 ModeAuto::start_command, ArduPlane 4.7 Plane::start_command",
    autopilot="ardupilot",
)
def _skipped(case: Case) -> Iterator[Issue]:
    skipped = _COPTER_SKIPS if case.vehicle.kind == "copter" else _PLANE_SKIPS
    for index, item in case.each(*skipped):
        yield Issue(
            index,
            f"{name_of(item.command)} is stored, but a {case.vehicle.kind} skips it",
            "remove the item, or check that --type is right",
        )


@RULES.add(
    "ardupilot-frame-mission",
    Level.WARNING,
    "ArduPilot takes coordinates in frame 2 for heights above sea level",
    "ArduPilot 4.7 AP_Mission::mavlink_int_to_mission_cmd",
    autopilot="ardupilot",
)
def _frame_mission(case: Case) -> Iterator[Issue]:
    for index, item in case.each(*FLOWN_TO):
        if item.frame == Frame.MISSION:
            yield Issue(
                index,
                f"frame 2 says that there are no coordinates, but ArduPilot flies there, at "
                f"{item.z:g} m above sea level",
                "use frame 3 for heights above home, 0 for heights above sea level",
            )


@RULES.add(
    "ardupilot-terrain",
    Level.WARNING,
    "heights above terrain: without terrain data ArduPilot does not arm",
    "measured on ArduCopter 4.7: frame 10 uploads, then arming is refused",
    autopilot="ardupilot",
)
def _terrain(case: Case) -> Iterator[Issue]:
    above = _above_terrain(case)
    if above and parameters.TERRAIN_ENABLE.of(case.vehicle) != 0:
        yield Issue(
            above[0],
            f"{len(above)} of the heights count from the terrain (frame 10 or 11): ArduPilot does "
            "not arm before it has the terrain data, and they are not checked here",
            "load the terrain data onto the vehicle's card, or use frame 3: height above home",
        )


@RULES.add(
    "ardupilot-terrain-off",
    Level.ERROR,
    "heights above terrain, but TERRAIN_ENABLE is 0",
    "ArduPilot 4.7 AP_Arming::terrain_checks",
    autopilot="ardupilot",
)
def _terrain_off(case: Case) -> Iterator[Issue]:
    above = _above_terrain(case)
    if above and parameters.TERRAIN_ENABLE.of(case.vehicle) == 0:
        yield Issue(
            above[0],
            f"{len(above)} of the heights count from the terrain (frame 10 or 11), but "
            "TERRAIN_ENABLE is 0",
            "set TERRAIN_ENABLE to 1, or use frame 3: height above home",
        )


def _above_terrain(case: Case) -> list[int]:
    return [index for index, item in case.each(*FLOWN_TO) if item.frame in ABOVE_TERRAIN]


@RULES.add(
    "px4-roi",
    Level.ERROR,
    "PX4 refuses this kind of region of interest (INVALID_PARAM1)",
    "PX4 1.16 MavlinkMissionManager::parse_mavlink_mission_item",
    autopilot="px4",
)
def _roi(case: Case) -> Iterator[Issue]:
    for index, item in case.each(*_ROI):
        allowed = _ROI_WITHOUT_PLACE if item.frame == Frame.MISSION else _ROI_WITH_PLACE
        mode = item.params[0]
        if math.isnan(mode) or math.trunc(mode) not in allowed:
            yield Issue(
                index,
                f"region of interest {mode:g} in frame {item.frame}; PX4 takes "
                f"{', '.join(map(str, allowed))} there",
                "use DO_SET_ROI_LOCATION (195) or DO_SET_ROI_NONE (197)",
            )


@RULES.add(
    "px4-fence-size",
    Level.WARNING,
    "more fence vertices or rally points than small PX4 boards store",
    "PX4: 64 fence vertices and 8 rally points on the smallest boards",
    autopilot="px4",
)
def _fence_size(case: Case) -> Iterator[Issue]:
    fence = case.mission.fence
    vertices = sum(len(polygon.vertices) for polygon in fence.polygons) + len(fence.circles)
    for count, limit, what in (
        (vertices, _FENCE_VERTICES, "fence vertices"),
        (len(case.mission.rally), _RALLY_POINTS, "rally points"),
    ):
        if count > limit:
            yield Issue(
                None,
                f"{count} {what}; the smallest boards store {limit}",
                "use fewer, or check that your board stores them",
            )
