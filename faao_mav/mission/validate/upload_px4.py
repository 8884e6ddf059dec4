"""What PX4 refuses when a mission is uploaded."""

import math
from collections.abc import Iterator

from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, Command, Frame
from faao_mav.mission.validate.case import Case, command_name
from faao_mav.mission.validate.finding import Level
from faao_mav.mission.validate.rule import Issue, Rules

RULES = Rules()

_SOURCE = "PX4 1.16 MavlinkMissionManager::parse_mavlink_mission_item; measured on 1.16.1"

_ROI = frozenset({80, 201})
_WITH_PLACE = _ROI | {16, 17, 19, 21, 22, 31, 84, 85, 195, 4501}
"""Commands accepted with global coordinates."""

_WITHOUT_PLACE = _ROI | {
    *(20, 93, 112, 114, 177, 178, 179, 187, 189, 196, 197, 200, 203, 204, 205, 206, 211, 214),
    *(260, 530, 531, 532, 1000, 1001, 2000, 2001, 2003, 2500, 2501, 3000, 42600),
}
"""Commands accepted in frame 2."""

_FRAMES = ABOVE_SEA | ABOVE_HOME
_ROI_WITH_PLACE, _ROI_WITHOUT_PLACE = (0, 3), (0, 1, 2)

_BOARD, _SIMULATION = 1_000, 10_000
_FENCE_VERTICES, _RALLY_POINTS = 64, 8


@RULES.add(
    "px4-command",
    Level.ERROR,
    "PX4 refuses a mission with this command (UNSUPPORTED)",
    _SOURCE,
    autopilot="px4",
)
def _command(case: Case) -> Iterator[Issue]:
    for index, item in enumerate(case.items):
        if item.command not in _WITH_PLACE | _WITHOUT_PLACE:
            yield Issue(
                index,
                f"PX4 does not take command {command_name(item.command)}",
                "replace it by plain waypoints"
                if item.command == Command.NAV_SPLINE_WAYPOINT
                else "remove the item or use a command that PX4 has",
            )


@RULES.add(
    "px4-frame",
    Level.ERROR,
    "PX4 refuses items in this frame (UNSUPPORTED_FRAME)",
    _SOURCE,
    autopilot="px4",
)
def _frame(case: Case) -> Iterator[Issue]:
    for index, item in enumerate(case.items):
        if item.frame not in _FRAMES | {Frame.MISSION}:
            yield Issue(
                index,
                f"frame {item.frame} is not supported; 0, 2, 3, 5 and 6 are",
                "use frame 3 for places (height above home), frame 2 for everything else",
            )


@RULES.add(
    "px4-command-frame",
    Level.ERROR,
    "PX4 takes this command, but in another frame (UNSUPPORTED)",
    _SOURCE,
    autopilot="px4",
)
def _command_frame(case: Case) -> Iterator[Issue]:
    for index, item in enumerate(case.items):
        if item.command in _ROI:
            continue
        if item.command in _WITHOUT_PLACE and item.frame in _FRAMES:
            yield Issue(
                index,
                f"command {command_name(item.command)} is in frame {item.frame}; PX4 takes it in "
                "frame 2 only and refuses the whole mission",
                "set the frame to 2",
            )
        elif item.command in _WITH_PLACE and item.frame == Frame.MISSION:
            yield Issue(
                index,
                f"command {command_name(item.command)} is in frame 2, which has no coordinates",
                "set the frame to 3: height above home",
            )


@RULES.add(
    "px4-roi",
    Level.ERROR,
    "PX4 refuses this kind of region of interest (INVALID_PARAM1)",
    _SOURCE,
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
    "px4-many-items",
    Level.WARNING,
    "the mission may be longer than PX4's storage (NO_SPACE)",
    "PX4 1.16: most flight boards store 1000 items; measured: 10,000 in simulation",
    autopilot="px4",
)
def _many(case: Case) -> Iterator[Issue]:
    if _BOARD < len(case.items) <= _SIMULATION:
        yield Issue(
            None,
            f"{len(case.items)} items; most flight boards store {_BOARD}",
            "thin the waypoints",
        )


@RULES.add(
    "px4-too-many-items",
    Level.ERROR,
    "the mission is longer than PX4's storage (NO_SPACE)",
    "measured on PX4 1.16.1: 10,000 items in simulation",
    autopilot="px4",
)
def _too_many(case: Case) -> Iterator[Issue]:
    if len(case.items) > _SIMULATION:
        yield Issue(
            None,
            f"{len(case.items)} items; PX4 stores {_SIMULATION} at most",
            "thin the waypoints",
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
