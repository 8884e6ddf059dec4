"""What tells one mock autopilot from another.

Sources: `MissionItemProtocol` of ArduPilot, `mavlink_mission` of PX4 (behaviour only), and what
both did in their simulators.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from faao_mav.mavlink.messages import Row
from faao_mav.mavlink.transfer.protocol import MissionType, Result
from faao_mav.mission.command import (
    CIRCLE,
    FENCE_RETURN_POINT,
    POLYGON,
    RALLY_POINT,
    Command,
    Frame,
)

MockKind: TypeAlias = Literal["ardupilot", "px4", "px4-legacy-first"]

COUNT = -1
"""In `Manners.refusals`: instead of a row, the announcement of the list."""

_FENCE_COMMANDS = frozenset({*POLYGON.values(), *CIRCLE.values(), FENCE_RETURN_POINT})
_MISSION_FRAME_ONLY = frozenset({Command.DO_CHANGE_SPEED, Command.NAV_RETURN_TO_LAUNCH, 93, 177})
_PX4_UNSUPPORTED = frozenset({18, 82, 92, 115})


@dataclass(frozen=True, slots=True)
class Manners:
    """How a mock autopilot takes lists.

    `limits` are rows it holds; `refusals` are results to answer a row (or `COUNT`) with, whatever
    it says. `complete_only`: PX4 acknowledges a repeated last item only when it has all of them
    (older versions acknowledge a repeated item of an upload that they gave up).
    """

    kind: MockKind = "ardupilot"
    limits: Mapping[MissionType, int] = field(
        default_factory=lambda: {
            MissionType.MISSION: 655,
            MissionType.FENCE: 84,
            MissionType.RALLY: 10,
        }
    )
    refusals: Mapping[tuple[int, int], Result] = field(default_factory=dict)
    ask_again: float = 1.0
    give_up: float = 8.0
    complete_only: bool = True


def ardupilot(**changes: object) -> Manners:
    """Return ArduPilot's manners, with some of them changed."""
    return Manners(**changes)  # type: ignore[arg-type]


def px4(**changes: object) -> Manners:
    """Return PX4's manners, with some of them changed."""
    limits = {MissionType.MISSION: 1000, MissionType.FENCE: 64, MissionType.RALLY: 8}
    own: dict[str, object] = {"kind": "px4", "limits": limits, "ask_again": 0.25, "give_up": 5.0}
    return Manners(**(own | changes))  # type: ignore[arg-type]


def manners_of(kind: MockKind) -> Manners:
    """Return the manners of `kind`."""
    return ardupilot() if kind == "ardupilot" else px4(kind=kind)


def check_row(row: Row, mission_type: int, kind: MockKind) -> Result:
    """Return what an autopilot answers to `row` as an item of that list."""
    if mission_type == MissionType.FENCE:
        return _check_fence_row(row, kind)
    if mission_type == MissionType.RALLY:
        if row.command != RALLY_POINT:
            return Result.UNSUPPORTED
        return Result.INVALID_PARAM7 if math.isnan(row.z) else _check_place(row)
    if kind == "ardupilot":
        return _check_ardupilot(row)
    return _check_px4(row)


def _check_ardupilot(row: Row) -> Result:
    if row.frame not in (0, 2, 3, 5, 6, 10, 11):
        return Result.UNSUPPORTED_FRAME
    if row.command in (0, 1):
        return Result.INVALID
    if row.command in _FENCE_COMMANDS or row.command == RALLY_POINT:
        return Result.UNSUPPORTED
    for number, value in enumerate(row.params):
        if not math.isfinite(value):
            return Result(Result.INVALID_PARAM1 + number)
    if not math.isfinite(row.z):
        return Result.INVALID_PARAM7
    return _check_place(row)


def _check_px4(row: Row) -> Result:
    if row.command in _FENCE_COMMANDS or row.command == RALLY_POINT:
        return Result.ERROR
    if row.frame not in (0, 2, 3, 5, 6):
        return Result.UNSUPPORTED_FRAME
    if row.command in _PX4_UNSUPPORTED:
        return Result.UNSUPPORTED
    if (row.frame != Frame.MISSION) == (row.command in _MISSION_FRAME_ONLY):
        # Plain numbers have no place, and places are no plain numbers.
        placed = row.command < 95 or row.command in _MISSION_FRAME_ONLY
        return Result.UNSUPPORTED if placed else Result.ACCEPTED
    return _check_place(row)


def _check_fence_row(row: Row, kind: MockKind) -> Result:
    if row.command not in _FENCE_COMMANDS:
        return Result.UNSUPPORTED
    if row.command in POLYGON.values() and row.params[0] < 3:
        return Result.INVALID_PARAM1 if kind == "ardupilot" else Result.ERROR
    return _check_place(row)


def _check_place(row: Row) -> Result:
    if row.frame == Frame.MISSION:
        return Result.ACCEPTED
    if abs(row.x) > 900_000_000:
        return Result.INVALID_PARAM5_X
    if abs(row.y) > 1_800_000_000:
        return Result.INVALID_PARAM6_Y
    return Result.ACCEPTED
