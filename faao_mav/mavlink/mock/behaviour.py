"""What a mock autopilot answers to lists and their items."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeAlias

from faao_mav.mavlink.messages import WireItem
from faao_mav.mavlink.protocol import MissionType, Result
from faao_mav.mavlink.wire_items import mission_item
from faao_mav.mission.command import (
    POLYGON,
    RALLY_POINT,
    Command,
    Frame,
)
from faao_mav.mission.item import Mission, MissionItem
from faao_mav.vehicle import AutopilotFamily, VehicleType
from faao_mav.vehicle.ardupilot.family import ARDUPILOT
from faao_mav.vehicle.dialect import FENCE_ROWS, ROWS_BESIDE
from faao_mav.vehicle.px4 import PX4

MockKind: TypeAlias = Literal["ardupilot", "px4", "px4-legacy-first"]

COUNT = -1
"""In `Behaviour.refusals`: instead of an item, the announcement of the list."""

_POSITIONS = frozenset({16, 17, 18, 19, 21, 22, 31, 82, 84, 85})
"""Commands that PX4 counts as positions."""

_FIELDS = range(Result.INVALID_PARAM1, Result.INVALID_PARAM7 + 1)
"""What is wrong if param1 to param4, x, y or z is."""


@dataclass(frozen=True, slots=True)
class Behaviour:
    """How a mock autopilot takes lists, beside its `Manners`.

    `mission_limit` is how many items of a mission it holds, home included. `modes` are its custom modes at rest and on a mission, by the type of vehicle; PX4 packs main
    and sub mode into one number (`packed_modes`). `parameters` are those that ground stations look
    for, beside the ones that the package knows. `refusals` are results to answer an item (or
    `COUNT`) with, whatever it says. `misplaced` is the answer to an item of a fence or rally point
    in a mission, `thin_polygon` to a fence polygon of fewer than three vertices, `nonsense` to
    commands 0 and 1. `legacy_first`: it asks with MISSION_REQUEST until it is sent
    MISSION_ITEM_INT. `complete_only`: a repeated last item is acknowledged only if all items are
    there (older PX4s acknowledge a repeated item of an upload that they gave up). `infeasible`
    says why a mission is not flown though it was taken, None if it is.
    """

    family: AutopilotFamily
    mission_limit: int
    modes: Mapping[str, tuple[int, int]]
    misplaced: Result
    thin_polygon: Result
    nonsense: Result
    packed_modes: bool = False
    parameters: Mapping[str, float] = field(default_factory=dict)
    legacy_first: bool = False
    complete_only: bool = True
    refusals: Mapping[tuple[int, int], Result] = field(default_factory=dict)
    infeasible: Callable[[Mission], str | None] = lambda _: None


def _px4_infeasible(mission: Mission) -> str | None:
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
    if positions[:1] == [Command.NAV_LAND]:
        return "starts with landing"
    return None


def packed_mode(main: int, sub: int) -> int:
    """Return PX4's custom mode for a main and a sub mode; 0 for numbers that are none."""
    if not (0 <= main < 256 and 0 <= sub < 256):
        return 0
    return main << 16 | sub << 24


_ARDUPILOT = Behaviour(
    ARDUPILOT,
    655,  # as in its simulator
    {"copter": (0, 3), "plane": (2, 10)},  # MAVLink's COPTER_MODE and PLANE_MODE
    misplaced=Result.UNSUPPORTED,
    thin_polygon=Result.INVALID_PARAM1,
    nonsense=Result.INVALID,
    parameters={"SYSID_THISMAV": 1, "FRAME_CLASS": 1},
    legacy_first=True,
)
_PX4 = Behaviour(
    PX4,
    1000,
    dict.fromkeys(("copter", "plane"), (packed_mode(4, 3), packed_mode(4, 4))),  # AUTO, sub modes
    misplaced=Result.ERROR,
    thin_polygon=Result.ERROR,
    nonsense=Result.UNSUPPORTED,
    packed_modes=True,
    infeasible=_px4_infeasible,
)
_BEHAVIOURS: dict[MockKind, Behaviour] = {
    "ardupilot": _ARDUPILOT,
    "px4": _PX4,
    "px4-legacy-first": replace(_PX4, legacy_first=True),
}


def behaviour_of(kind: MockKind, **changes: Any) -> Behaviour:
    """Return the behaviour of `kind`, with some fields changed.

    >>> behaviour_of("px4", complete_only=False).family.name
    'PX4'
    """
    return replace(_BEHAVIOURS[kind], **changes)


def size_limit(mission_type: MissionType, behaviour: Behaviour, vehicle: VehicleType) -> int:
    """Return how many items of that list `vehicle` holds."""
    dialect = vehicle.dialect
    return (behaviour.mission_limit, dialect.fence_rows, dialect.rally_rows)[mission_type]


def check_item(
    item: WireItem, mission_type: MissionType, behaviour: Behaviour, vehicle: VehicleType
) -> Result:
    """Return what `vehicle` answers to `item` of that list."""
    if mission_type is MissionType.FENCE:
        if item.command not in FENCE_ROWS:
            return Result.UNSUPPORTED
        thin = item.command in POLYGON.values() and item.params[0] < 3
        return behaviour.thin_polygon if thin else _check_place(item)
    if mission_type is MissionType.RALLY:
        if item.command != RALLY_POINT:
            return Result.UNSUPPORTED
        return Result.INVALID_PARAM7 if item.z != item.z else _check_place(item)
    if item.command in ROWS_BESIDE:
        return behaviour.misplaced
    if item.command in (0, 1):
        return behaviour.nonsense
    return _check_mission_item(mission_item(item), vehicle)


def _check_mission_item(item: MissionItem, vehicle: VehicleType) -> Result:
    """Return what is wrong with `item`: the first field that `vehicle` does not take.

    Fields are tried in the order of the message, those behind the one tried set to 0.
    """
    refusal = vehicle.dialect.refusal
    if item.frame != Frame.MISSION and refusal(MissionItem(16, item.frame)):
        return Result.UNSUPPORTED_FRAME
    values = (*item.params, item.x, item.y, item.z)
    for tried in range(len(values) + 1):
        one, two, three, four, x, y, z = (*values[:tried], *[0.0] * (len(values) - tried))
        variant = replace(item, params=(one, two, three, four), x=x, y=y, z=z)
        if refusal(variant) is not None:
            return Result.UNSUPPORTED if tried == 0 else Result(_FIELDS[tried - 1])
    return Result.ACCEPTED


def _check_place(item: WireItem) -> Result:
    if abs(item.x) > 900_000_000:
        return Result.INVALID_PARAM5_X
    if abs(item.y) > 1_800_000_000:
        return Result.INVALID_PARAM6_Y
    return Result.ACCEPTED
