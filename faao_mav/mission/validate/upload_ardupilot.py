"""What ArduPilot refuses when a mission is uploaded."""

import math
from collections.abc import Iterator

from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, ABOVE_TERRAIN, FLOWN_TO, Command, Frame
from faao_mav.mission.validate import parameters
from faao_mav.mission.validate.case import Case, command_name
from faao_mav.mission.validate.finding import Level
from faao_mav.mission.validate.rule import Issue, Rules

RULES = Rules()

_SOURCE = "ArduPilot 4.7 AP_Mission::mavlink_int_to_mission_cmd"

_FLYING = frozenset({16, 17, 18, 19, 20, 21, 22, 30, 31, 36, 82, 83, 84, 85, 92, 93, 94, 213})
_CONDITIONS = frozenset({112, 114, 115})
_ACTIONS = frozenset(
    {
        *(177, 178, 179, 181, 182, 183, 184, 188, 189, 191, 193, 194, 195, 197),
        *(201, 202, 203, 205, 206, 207, 208, 210, 211, 212, 215, 216, 217, 218, 222, 223),
        *(530, 531, 532, 534, 600, 601, 1000, 2000, 2001, 2500, 2501, 3000),
        *(42600, 42702, 42703),
    }
)
_ACCEPTED = _FLYING | _CONDITIONS | _ACTIONS
_COPTER_SKIPS = frozenset({30, 83, 191, 194, 210, 212, 223, 3000})
_PLANE_SKIPS = frozenset({115, 213, 222, 42600})

_LOCATED = FLOWN_TO | {30, 92, 94, 179, 189, 191, 195, 201}
"""Commands whose coordinates ArduPilot stores as a location."""

_FRAMES = ABOVE_SEA | ABOVE_HOME | ABOVE_TERRAIN | {Frame.MISSION}
_MAY_BE_NAN = {16: {4}, 21: {4}, 22: {4}, 84: {4}, 85: {3, 4}}
_ALTITUDE_LIMIT = 83_000.0  # LOCATION_ALT_MAX_M

_SURELY_STORED = 650  # home included; flown so on ArduCopter 4.7's default storage
_NEVER_STORED = {"copter": 718, "plane": 724}
_JUMPS_SMALL, _JUMPS_LARGE = 15, 100


@RULES.add(
    "ardupilot-command",
    Level.ERROR,
    "ArduPilot refuses a mission with this command (UNSUPPORTED)",
    _SOURCE,
    autopilot="ardupilot",
)
def _command(case: Case) -> Iterator[Issue]:
    for index, item in enumerate(case.items):
        if item.command not in _ACCEPTED or _spline_on_plane(case, item.command):
            yield Issue(
                index,
                f"ArduPilot's {case.vehicle.kind} does not take command "
                f"{command_name(item.command)}",
                "replace it by plain waypoints"
                if item.command == Command.NAV_SPLINE_WAYPOINT
                else "remove the item or use a command that it has",
            )


def _spline_on_plane(case: Case, command: int) -> bool:
    return command == Command.NAV_SPLINE_WAYPOINT and case.vehicle.kind == "plane"


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
            f"command {command_name(item.command)} is stored, but a {case.vehicle.kind} skips it",
            "remove the item, or check that --type is right",
        )


@RULES.add(
    "ardupilot-frame",
    Level.ERROR,
    "ArduPilot refuses coordinates in this frame (UNSUPPORTED_FRAME)",
    f"{_SOURCE}; measured on 4.7",
    autopilot="ardupilot",
)
def _frame(case: Case) -> Iterator[Issue]:
    for index, item in case.each(*_LOCATED):
        if item.frame not in _FRAMES:
            yield Issue(
                index,
                f"frame {item.frame} is not supported for coordinates; 0, 2, 3, 5, 6, 10, 11 are",
                "use frame 3: height above home",
            )


@RULES.add(
    "ardupilot-frame-mission",
    Level.WARNING,
    "ArduPilot takes coordinates in frame 2 for heights above sea level",
    _SOURCE,
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
    above = [index for index, item in case.each(*_LOCATED) if item.frame in ABOVE_TERRAIN]
    if above and parameters.TERRAIN_ENABLE.of(case.vehicle) != 0:
        yield Issue(
            above[0],
            f"{len(above)} items count their height from the terrain (frame 10 or 11): ArduPilot "
            "does not arm before it has the terrain data, and they are not checked here",
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
    above = [index for index, item in case.each(*_LOCATED) if item.frame in ABOVE_TERRAIN]
    if above and parameters.TERRAIN_ENABLE.of(case.vehicle) == 0:
        yield Issue(
            above[0],
            f"{len(above)} items count their height from the terrain (frame 10 or 11), but "
            "TERRAIN_ENABLE is 0",
            "set TERRAIN_ENABLE to 1, or use frame 3: height above home",
        )


@RULES.add(
    "ardupilot-nan",
    Level.ERROR,
    "ArduPilot refuses a parameter that is not set (NaN)",
    "ArduPilot 4.7 AP_Mission::sanity_check_params",
    autopilot="ardupilot",
)
def _nan(case: Case) -> Iterator[Issue]:
    for index, item in enumerate(case.items):
        allowed = _MAY_BE_NAN.get(item.command, set())
        empty = [
            f"param{n}"
            for n, value in enumerate(item.params, start=1)
            if math.isnan(value) and n not in allowed
        ]
        if item.command in _LOCATED and math.isnan(item.z):
            empty.append("the altitude")
        if empty:
            yield Issue(
                index,
                f"{' and '.join(empty)} of command {command_name(item.command)} "
                f"{'is' if len(empty) == 1 else 'are'} not set (NaN), which ArduPilot refuses",
                "write 0 or the value that you mean",
            )


@RULES.add(
    "ardupilot-altitude-range",
    Level.ERROR,
    "ArduPilot refuses an altitude of 83 km or more",
    _SOURCE,
    autopilot="ardupilot",
)
def _altitude_range(case: Case) -> Iterator[Issue]:
    for index, item in case.each(*_LOCATED):
        if abs(item.z) >= _ALTITUDE_LIMIT:
            yield Issue(
                index,
                f"altitude {item.z:g} m; ArduPilot stores less than {_ALTITUDE_LIMIT:g} m",
                "correct the altitude; it is in metres",
            )


@RULES.add(
    "ardupilot-too-many-items",
    Level.ERROR,
    "the mission is longer than ArduPilot's storage (NO_SPACE)",
    "ArduPilot: 15 bytes an item, 718 items (Copter), 724 (Plane); measured on 4.7",
    autopilot="ardupilot",
)
def _too_many(case: Case) -> Iterator[Issue]:
    limit = _NEVER_STORED[case.vehicle.kind]
    rows = len(case.items) + 1
    if rows >= limit and not _on_card(case):
        yield Issue(
            None,
            f"{rows} items with home; ArduPilot stores fewer than {limit}",
            "thin the waypoints, or set BRD_SD_MISSION to store missions on the card",
        )


@RULES.add(
    "ardupilot-many-items",
    Level.WARNING,
    "the mission may be longer than ArduPilot's storage",
    "measured on ArduCopter 4.7: 650 items fit, 718 do not",
    autopilot="ardupilot",
)
def _many(case: Case) -> Iterator[Issue]:
    rows = len(case.items) + 1
    if _SURELY_STORED < rows < _NEVER_STORED[case.vehicle.kind] and not _on_card(case):
        yield Issue(
            None,
            f"{rows} items with home; {_SURELY_STORED} are known to fit, and boards differ",
            "thin the waypoints, or set BRD_SD_MISSION to store missions on the card",
        )


def _on_card(case: Case) -> bool:
    return parameters.SD_STORAGE.of(case.vehicle) > 0


@RULES.add(
    "ardupilot-many-jumps",
    Level.WARNING,
    "more DO_JUMPs than ArduPilot counts repeats of",
    "ArduPilot 4.7 AP_MISSION_MAX_NUM_DO_JUMP_COMMANDS: 15, on large boards 100",
    autopilot="ardupilot",
)
def _many_jumps(case: Case) -> Iterator[Issue]:
    jumps = [index for index, _ in case.each(Command.DO_JUMP)]
    if len(jumps) > _JUMPS_SMALL:
        limit = _JUMPS_LARGE if len(jumps) > _JUMPS_LARGE else _JUMPS_SMALL
        yield Issue(
            jumps[limit],
            f"this is DO_JUMP number {limit + 1} of {len(jumps)}; boards count the repeats of "
            f"{_JUMPS_SMALL}, large ones of {_JUMPS_LARGE}, and do not jump at the others",
            "write the repeated items out",
        )
