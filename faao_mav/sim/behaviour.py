"""What the mocks of different autopilots differ in, as data."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from faao_mav.autopilot import AutopilotFamily
from faao_mav.autopilot.ardupilot import ARDUPILOT
from faao_mav.autopilot.dialect import BESIDE
from faao_mav.autopilot.px4 import PX4, px4_mode
from faao_mav.mission.command import (
    ABOVE_HOME,
    ABOVE_SEA,
    POLYGON,
    RALLY_POINT,
    Command,
    Frame,
)
from faao_mav.mission.item import Mission
from faao_mav.wire.messages import CommandLong, WireItem
from faao_mav.wire.protocol import MavResult, MissionType
from faao_mav.wire.wire_items import GLOBAL_FRAMES

COUNT = -1
"""In `Behaviour.refusals`: instead of an item, the announcement of the list."""

_RALLY_HIGHEST = 2**15
"""The altitude from which on ArduPilot refuses a rally point, m: what 16 bits hold."""

_POSITIONS = frozenset({16, 17, 18, 19, 21, 22, 31, 82, 84, 85})
"""Commands that PX4 counts as positions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Behaviour:
    """The autopilot that a mock is, and how that differs from others.

    Attributes:
        family: the autopilot.
        legacy_first: it asks with MISSION_REQUEST; PX4 until it is sent MISSION_ITEM_INT.
        numbers_lists: it tells a number for each list.
        mission_limit: how many items of a mission it holds, home included.
        timeout_text: what it says when it gives up an upload.
        unknown_list: the answer to what is about no list that it has.
        misplaced: the answer to an item of a fence, or a rally point, in a mission.
        nonsense: the answer to commands 0 and 1.
        beside: the answer to an item of a fence or of rally points that is on Earth.
        infeasible: why a mission is not flown though it was taken, "" if it is.
        requested_mode: the custom mode that DO_SET_MODE asks for, None if it asks for none.
        parameters: what ground stations look for beside the parameters that the package knows.
        silent_at_boot: it answers nothing about lists before it is ready.
        tells_no_place: it tells latitude and longitude 0 as long as it knows none; else nothing.
        returns_by_mode: the types of vehicle that change their mode when a mission has them return.
        fence_text: what it says when it leaves the fence.
        armed_inside_only: it does not arm where home lies outside the fence.
        mode_denied, no_mode: the MAV_RESULT of a mode that it does not enter, and of no such mode.
        not_armed, not_armed_text: the MAV_RESULT with which it does not arm, and what it says.
        refusals: results to answer an item (or `COUNT`) with, whatever it says.
        complete_only: PX4 acknowledges a repeated last item only if it has all items; older ones
            acknowledge a repeated item of an upload that they gave up.
    """

    family: AutopilotFamily
    legacy_first: bool = False
    numbers_lists: bool = False
    mission_limit: int
    timeout_text: str
    unknown_list: MavResult
    misplaced: MavResult
    nonsense: MavResult
    beside: Callable[[MissionType, WireItem], MavResult]
    infeasible: Callable[[Mission], str] = lambda _: ""
    requested_mode: Callable[[CommandLong], int | None]
    parameters: Mapping[str, float] = field(default_factory=dict)
    silent_at_boot: bool = False
    tells_no_place: bool = False
    returns_by_mode: frozenset[str]
    fence_text: str
    armed_inside_only: bool = False
    mode_denied: int
    no_mode: int
    not_armed: int
    not_armed_text: str
    refusals: Mapping[tuple[int, int], MavResult] = field(default_factory=dict)
    complete_only: bool = True


def whole(param: float) -> int:
    """Return a command's parameter as a number of something, -1 if it cannot be one."""
    return int(param) if 0 <= param < 2**32 else -1


def _is_custom(command: CommandLong) -> bool:
    """Tell whether DO_SET_MODE asks for a custom mode (MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)."""
    flags = whole(command.param1)
    return flags > 0 and flags % 2 == 1


def _ardupilot_mode(command: CommandLong) -> int | None:
    number = whole(command.param2)
    return number if _is_custom(command) and number >= 0 else None


def _px4_mode(command: CommandLong) -> int | None:
    mode = px4_mode(whole(command.param2), whole(command.param3))
    return mode if _is_custom(command) and mode else None


def _ardupilot_beside(part: MissionType, item: WireItem) -> MavResult:
    if (item.command == RALLY_POINT) != (part is MissionType.RALLY) or item.command not in BESIDE:
        return MavResult.UNSUPPORTED
    if item.frame not in GLOBAL_FRAMES:
        return MavResult.UNSUPPORTED_FRAME
    fits = part is MissionType.FENCE or abs(item.z) < _RALLY_HIGHEST
    return MavResult.ACCEPTED if fits else MavResult.INVALID_PARAM7


def _px4_beside(_: MissionType, item: WireItem) -> MavResult:
    if item.frame == Frame.MISSION:
        return MavResult.UNSUPPORTED
    if item.frame not in ABOVE_SEA | ABOVE_HOME:
        return MavResult.UNSUPPORTED_FRAME
    thin = item.command in POLYGON.values() and not item.params[0] >= 3
    return MavResult.ERROR if thin else MavResult.ACCEPTED


def _px4_infeasible(mission: Mission) -> str:
    """Return why PX4, which says so in an event only, refuses to start `mission`."""
    commands = [item.command for item in mission.items]
    positions = [command for command in commands if command in _POSITIONS]
    takeoffs = [item for item in mission.items if item.command == Command.NAV_TAKEOFF]
    if Command.CONDITION_DELAY in commands:
        return "unsupported command"
    if any(item.z <= 0 for item in takeoffs):
        return "take-off altitude too low"
    if len(takeoffs) > 1 or (takeoffs and positions[0] != Command.NAV_TAKEOFF):
        return "take-off is not the first position"
    return "starts with landing" if positions[:1] == [Command.NAV_LAND] else ""


MOCK_ARDUPILOT = Behaviour(
    family=ARDUPILOT,
    legacy_first=True,
    mission_limit=655,  # as in its simulator
    timeout_text="Mission upload timeout",
    unknown_list=MavResult.UNSUPPORTED,
    misplaced=MavResult.UNSUPPORTED,
    nonsense=MavResult.INVALID,
    beside=_ardupilot_beside,
    requested_mode=_ardupilot_mode,
    parameters={"SYSID_THISMAV": 1, "FRAME_CLASS": 1, "BATT_MONITOR": 4},
    tells_no_place=True,
    returns_by_mode=frozenset({"plane"}),
    fence_text="Polygon fence breached",
    armed_inside_only=True,
    mode_denied=4,  # failed
    no_mode=2,  # denied
    not_armed=4,
    not_armed_text="Arm: {}",
)

MOCK_PX4 = Behaviour(
    family=PX4,
    numbers_lists=True,
    mission_limit=1000,
    timeout_text="Operation timeout\t",
    unknown_list=MavResult.INVALID,
    misplaced=MavResult.ERROR,
    nonsense=MavResult.UNSUPPORTED,
    beside=_px4_beside,
    infeasible=_px4_infeasible,
    requested_mode=_px4_mode,
    silent_at_boot=True,
    returns_by_mode=frozenset({"copter", "plane"}),
    fence_text="Geofence: approaching or outside geofence",
    mode_denied=1,  # temporarily rejected
    no_mode=0,  # accepted, but nothing changes
    not_armed=1,
    not_armed_text="Arming denied: {}\t",
)
