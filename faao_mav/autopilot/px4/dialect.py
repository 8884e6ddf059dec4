"""PX4: items with a place in frames 0, 3, 5, 6; all others in frame 2, and only there."""

import math
from dataclasses import replace

import numpy as np

from faao_mav.autopilot.dialect import (
    BESIDE,
    NOTHING,
    Codec,
    Codecs,
    Dialect,
    Limit,
    SpeedChange,
    degrees,
    dropped,
    flag,
    misplaced,
    name_of,
    single,
    through,
    whole,
)
from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, RALLY_POINT, Command, Frame
from faao_mav.mission.item import MissionItem


def _heading(value: float) -> float:
    """Degrees from 0 to below 360; NaN, no heading, stays."""
    turned = float(np.float32(value) % np.float32(360))
    return 0.0 if turned == 360 else turned  # just below 0 rounds up


def _fourth(codec: Codec) -> Codecs:
    return (dropped, dropped, dropped, codec)


_GATE = 4501

_PLACED: dict[int, Codecs] = {
    Command.NAV_WAYPOINT: (single, single, dropped, _heading),
    Command.NAV_LOITER_UNLIM: (dropped, dropped, single, _heading),
    Command.NAV_LOITER_TIME: (single, flag, single, flag),
    Command.NAV_LAND: (dropped, whole(0, 65_535), dropped, _heading),
    Command.NAV_TAKEOFF: _fourth(_heading),
    Command.NAV_LOITER_TO_ALT: (flag, single, dropped, flag),
    Command.NAV_VTOL_TAKEOFF: _fourth(_heading),
    Command.NAV_VTOL_LAND: _fourth(_heading),
    Command.DO_SET_ROI_LOCATION: NOTHING,
    Command.DO_SET_ROI: NOTHING,
    80: NOTHING,
    _GATE: NOTHING,
}
"""Commands in the frames of places, and what is read back of their parameters."""

_UNPLACED = frozenset(
    {
        Command.NAV_RETURN_TO_LAUNCH,
        Command.NAV_DELAY,
        Command.CONDITION_DELAY,
        Command.CONDITION_DISTANCE,
        Command.DO_JUMP,
        Command.DO_CHANGE_SPEED,
        Command.DO_SET_HOME,
        Command.DO_LAND_START,
        Command.DO_SET_ROI_NONE,
        Command.DO_SET_ROI,
        *(80, 187, 196, 200, 203, 204, 205, 206, 211, 212, 214, 260, 400),
        *(530, 531, 532, 534, 1000, 1001, 2000, 2001, 2003, 2500, 2501, 3000, 42_600),
    }
)
"""Commands in frame 2."""

_JUMP: Codecs = (whole(-32_768, 32_767), whole(0, 65_535), single, single)


def _refusal(item: MissionItem) -> str | None:
    name = name_of(item.command)
    if item.frame == Frame.MISSION:
        if item.command in _UNPLACED:
            return None
        if item.command in _PLACED:
            return f"PX4 takes {name} in frames 0, 3, 5 and 6 only, not 2 (MISSION)"
        return f"PX4 does not support {name} in missions"
    if item.frame not in ABOVE_SEA | ABOVE_HOME:
        return f"PX4 does not support frame {item.frame}; give one of 0, 2, 3, 5, 6"
    if item.command not in _PLACED:
        if item.command in _UNPLACED:
            return f"PX4 takes {name} in frame 2 (MISSION) only, not {item.frame}"
        return f"PX4 does not support {name} in missions"
    if (wrong := misplaced(item)) is not None:
        place, value, limit = wrong
        return f"PX4 has no use for {place} {value:g}; give degrees within {limit}"
    return None


def _stored(item: MissionItem) -> MissionItem:
    if item.command in BESIDE:
        return _stored_beside(item)
    if item.frame == Frame.MISSION:
        codecs = _JUMP if item.command == Command.DO_JUMP else (single, single, single, single)
        x, y = (0.0 if math.isnan(v) else float(round(v)) for v in (item.x, item.y))
        return replace(through(codecs, item), x=x, y=y, z=single(item.z))
    above_home = item.frame in ABOVE_HOME
    return replace(
        through(_PLACED.get(item.command, NOTHING), item),
        frame=Frame.GLOBAL_RELATIVE_ALT_INT if above_home else Frame.GLOBAL_INT,
        x=degrees(item.x),
        y=degrees(item.y),
        z=single(item.z),
    )


def _stored_beside(item: MissionItem) -> MissionItem:
    """Of a rally point PX4 keeps what its altitude counts from, of a row of the fence nothing."""
    relative = item.command == RALLY_POINT and item.frame in ABOVE_HOME
    return replace(
        through(BESIDE[item.command], item),
        frame=Frame.GLOBAL_RELATIVE_ALT_INT if relative else Frame.GLOBAL_INT,
        autocontinue=item.autocontinue and item.command == RALLY_POINT,
    )


def _speed_change(item: MissionItem) -> SpeedChange | None:
    """The type does not matter; what is not above 0 brings the default back."""
    speed = item.params[1]
    return SpeedChange("horizontal", speed if speed > 0 else None)


DIALECT = Dialect(
    home_row=False,
    items=Limit(1_000, 10_000),  # most boards; the simulator, measured
    jumps=None,
    fence_rows=64,
    rally_rows=8,
    atomic=True,
    unset_is_zero=False,
    zero_means_here=False,
    placed_in_mission_frame=False,
    refusal=_refusal,
    stored=_stored,
    speed_change=_speed_change,
)
"""PX4's dialect, whatever it flies."""
