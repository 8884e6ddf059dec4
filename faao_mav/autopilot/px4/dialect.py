"""PX4: items with a place in frames 0, 3, 5, 6; all others in frame 2, and only there."""

import numpy as np

from faao_mav.autopilot.dialect import (
    ALL,
    NOTHING,
    Codecs,
    Dialect,
    Limit,
    SpeedChange,
    dropped,
    flag,
    single,
    whole,
)
from faao_mav.mission.command import FLOWN_TO, Command, Frame
from faao_mav.mission.item import MissionItem

CONDITIONS = (Command.CONDITION_DELAY, Command.CONDITION_DISTANCE)
"""Commands that it takes, and starts no mission with."""

LEAST_TAKEOFF = 1e-3
"""The least height above home, m, that is above 0 to PX4: it adds home's height above the sea, in
single precision. A billionth was refused."""

FLIES = FLOWN_TO | {Command.NAV_RETURN_TO_LAUNCH, 187, 211, 4501, 42600}
"""What checkTakeoff counts as flying: actuators, grippers, winches and gates as well."""


def _heading(value: float) -> float:
    """Degrees from 0 to below 360; NaN, no heading, stays."""
    turned = float(np.float32(value) % np.float32(360))
    return 0.0 if turned == 360 else turned  # just below 0 rounds up


_YAW: Codecs = (dropped, dropped, dropped, _heading)
_GATE, _ROI = 4501, 80

_PLACED: dict[int, Codecs] = {
    Command.NAV_WAYPOINT: (single, single, dropped, _heading),
    Command.NAV_LOITER_UNLIM: (dropped, dropped, single, _heading),
    Command.NAV_LOITER_TIME: (single, flag, single, flag),
    Command.NAV_LAND: (dropped, whole(0, 65_535), dropped, _heading),
    Command.NAV_LOITER_TO_ALT: (flag, single, dropped, flag),
    **dict.fromkeys((Command.NAV_TAKEOFF, Command.NAV_VTOL_TAKEOFF, Command.NAV_VTOL_LAND), _YAW),
    **dict.fromkeys((Command.DO_SET_ROI_LOCATION, Command.DO_SET_ROI, _ROI, _GATE), NOTHING),
}
_KEPT_WHOLE = (
    *(20, _ROI, 93, 112, 114, 178, 179, 187, 189, 196, 197, 200, 201, 203, 204, 205, 206, 211, 212),
    *(214, 260, 400, 530, 531, 532, 534, 1000, 1001, 2000, 2001, 2003, 2500, 2501, 3000, 42_600),
)
_UNPLACED: dict[int, Codecs] = {
    **dict.fromkeys(_KEPT_WHOLE, ALL),
    Command.DO_JUMP: (whole(-32_768, 32_767), whole(0, 65_535), single, single),
}


def _speed_change(item: MissionItem) -> SpeedChange | None:
    """The type does not matter; what is not above 0 brings the default back."""
    speed = item.params[1]
    return SpeedChange("horizontal", speed if speed > 0 else None)


_SEA, _HOME = Frame.GLOBAL_INT, Frame.GLOBAL_RELATIVE_ALT_INT

DIALECT = Dialect(
    name="PX4",
    home_row=False,
    items=Limit(1_000, 10_000),  # most boards; the simulator, measured
    jumps=None,
    fence_rows=64,
    rally_rows=8,
    atomic=True,
    unset_is_zero=False,
    zero_means_here=False,
    placed=_PLACED,
    unplaced=_UNPLACED,
    frames={0: _SEA, 3: _HOME, 5: _SEA, 6: _HOME},
    idle_frames={2: Frame.MISSION},
    speed_change=_speed_change,
)
"""PX4's dialect, whatever it flies."""
