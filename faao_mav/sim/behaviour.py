"""What the mocks of different autopilots differ in, as data."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeAlias

from faao_mav.autopilot import AutopilotFamily
from faao_mav.autopilot.ardupilot import ARDUPILOT
from faao_mav.autopilot.dialect import BESIDE
from faao_mav.autopilot.px4 import CONDITIONS, FLIES, LEAST_TAKEOFF, PX4, px4_mode
from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, POLYGON, RALLY_POINT, Command, Frame
from faao_mav.mission.item import Mission
from faao_mav.wire.messages import WireItem
from faao_mav.wire.protocol import MavResult, MissionType
from faao_mav.wire.wire_items import GLOBAL_FRAMES

MockKind: TypeAlias = Literal["ardupilot", "px4"]

COUNT = -1
"""In `Behaviour.refusals`: instead of an item, the announcement of the list."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Behaviour:
    """The autopilot that a mock is, and how that differs from others."""

    family: AutopilotFamily
    mission_limit: int  # How many items of a mission it holds, home included
    # What it answers to an item of a list, beside what its dialect refuses of a mission
    answer: Callable[[MissionType, WireItem], MavResult]
    # The custom mode that DO_SET_MODE asks for by its second and third parameter, None for none
    requested_mode: Callable[[int, int], int | None]
    no_mode: int  # The MAV_RESULT for no such mode
    denied: int  # That of a mode that it does not enter, and with which it does not arm
    rewinds: bool = False  # Its mission begins anew once it is disarmed
    # What ground stations look for beside the parameters that the package knows
    parameters: Mapping[str, float] = field(default_factory=dict)
    numbers_missions: bool = False  # It tells a number for each mission
    silent_at_boot: bool = False  # It answers nothing about lists before it is ready
    tells_no_place: bool = False  # It tells 0, 0 as long as it knows no place; else nothing
    armed_inside_only: bool = False  # It does not arm where home lies outside the fence
    # Why a mission is not flown though it was taken, "" if it is
    infeasible: Callable[[Mission], str] = lambda _: ""
    # Results to answer an item (or `COUNT`) of a list with, whatever it says
    refusals: Mapping[tuple[int, int], MavResult] = field(default_factory=dict)


def whole(param: float) -> int:
    """Return a command's parameter as a number of something, -1 if it cannot be one."""
    return int(param) if 0 <= param < 2**32 else -1


def _ardupilot_answer(part: MissionType, item: WireItem) -> MavResult:
    beside = item.command in BESIDE
    if part is MissionType.MISSION and not beside:
        return MavResult.INVALID if item.command in (0, 1) else MavResult.ACCEPTED
    rally = item.command == RALLY_POINT
    if not beside or part is MissionType.MISSION or rally != (part is MissionType.RALLY):
        return MavResult.UNSUPPORTED
    if item.frame not in GLOBAL_FRAMES:
        return MavResult.UNSUPPORTED_FRAME
    fits = not rally or abs(item.z) < 2**15  # m: what 16 bits hold
    return MavResult.ACCEPTED if fits else MavResult.INVALID_PARAM7


def _px4_answer(part: MissionType, item: WireItem) -> MavResult:
    if part is MissionType.MISSION:
        return MavResult.ERROR if item.command in BESIDE else MavResult.ACCEPTED
    if item.frame == Frame.MISSION:
        return MavResult.UNSUPPORTED
    if item.frame not in ABOVE_SEA | ABOVE_HOME:
        return MavResult.UNSUPPORTED_FRAME
    thin = item.command in POLYGON.values() and not item.params[0] >= 3
    return MavResult.ERROR if thin else MavResult.ACCEPTED


def _px4_infeasible(mission: Mission) -> str:
    """Return why PX4, which says so in an event only, refuses to start `mission`."""
    flying = [item.command for item in mission.items if item.command in FLIES]
    takeoffs = [item for item in mission.items if item.command == Command.NAV_TAKEOFF]
    if any(item.command in CONDITIONS for item in mission.items):
        return "unsupported command"
    if any(item.z < LEAST_TAKEOFF for item in takeoffs):
        return "take-off altitude too low"
    if len(takeoffs) > 1 or (takeoffs and flying[0] != Command.NAV_TAKEOFF):
        return "take-off is not the first position"
    return "starts with landing" if flying[:1] == [Command.NAV_LAND] else ""


_BEHAVIOURS: dict[MockKind, Behaviour] = {
    "ardupilot": Behaviour(
        family=ARDUPILOT,
        mission_limit=655,  # as in its simulator
        answer=_ardupilot_answer,
        requested_mode=lambda mode, _: mode if mode >= 0 else None,
        no_mode=2,  # denied
        denied=4,  # failed
        rewinds=True,
        parameters={"SYSID_THISMAV": 1, "FRAME_CLASS": 1, "BATT_MONITOR": 4},
        tells_no_place=True,
        armed_inside_only=True,
    ),
    "px4": Behaviour(
        family=PX4,
        mission_limit=1000,
        answer=_px4_answer,
        requested_mode=lambda main, sub: px4_mode(main, sub) or None,
        no_mode=0,  # accepted, but nothing changes
        denied=1,  # temporarily rejected
        numbers_missions=True,
        silent_at_boot=True,
        infeasible=_px4_infeasible,
    ),
}


def behaviour_of(kind: MockKind, **changes: Any) -> Behaviour:
    """Return the behaviour of `kind`, with some fields changed.

    >>> behaviour_of("px4", numbers_missions=False).family.name
    'PX4'
    """
    return replace(_BEHAVIOURS[kind], **changes)
