"""ArduCopter and ArduPlane: items are squeezed into 15 bytes each."""

import math
from collections.abc import Mapping

import numpy as np

from faao_mav.autopilot.dialect import (
    NOTHING,
    UNKNOWN,
    Codecs,
    Dialect,
    Limit,
    SpeedAxis,
    SpeedChange,
    dropped,
    first,
    flag,
    single,
    whole,
)
from faao_mav.mission.command import LANDINGS, Command, Frame
from faao_mav.mission.item import MissionItem

_HIGHEST = 83_000.0  # The altitude from which on items are refused, m. Read in AP_Mission.

_CONTINUE_AFTER_LAND = 4
"""The bit of MIS_OPTIONS by which a take-off behind a landing is flown. Measured on ArduCopter 4.7:
without it the mission ends there, and with it before any other item too."""

_uint8, _uint16 = whole(0, 255), whole(0, 65_535)
_int8, _int16 = whole(-128, 127), whole(-32_768, 32_767)


def _direction(value: float) -> float:
    """Clockwise or not is all that is stored."""
    return -1.0 if value < 0 else 1.0


def _signed_radius(value: float) -> float:
    return math.copysign(_uint16(abs(value)), value) if abs(value) >= 1 else 0.0


def _turning_radius(value: float) -> float:
    """Eight bits: above 255 m in tens of metres."""
    radius = abs(value)
    stored = _uint8(radius) if radius <= 255 else 10 * _uint8(float(np.float32(radius) * 0.1))
    return math.copysign(stored, value) if stored else 0.0


def _altitude(value: float) -> float:
    """Whole centimetres."""
    centimetres = int(np.float32(min(max(value, -_HIGHEST), _HIGHEST)) * np.float32(100))
    return float(np.float32(centimetres) * np.float32(0.01))


_PLACED: dict[int, Codecs] = {
    Command.NAV_LOITER_UNLIM: (dropped, dropped, _signed_radius, dropped),
    Command.NAV_LOITER_TURNS: (_uint8, dropped, _turning_radius, flag),
    Command.NAV_LOITER_TIME: (_uint16, dropped, _direction, flag),
    Command.NAV_LAND: (_uint16, dropped, dropped, _direction),
    Command.NAV_TAKEOFF: first(_uint16),
    Command.NAV_LOITER_TO_ALT: (dropped, _signed_radius, dropped, flag),
    Command.NAV_VTOL_TAKEOFF: NOTHING,
    Command.NAV_VTOL_LAND: first(_uint16),
    Command.DO_SET_HOME: first(_uint16),
    Command.DO_LAND_START: NOTHING,
    Command.DO_SET_ROI_LOCATION: NOTHING,
    Command.DO_SET_ROI: first(_uint16),
    **dict.fromkeys((30, 92, 94, 188, 191), UNKNOWN),
}
_COPTER_PLACED: dict[int, Codecs] = {
    Command.NAV_WAYPOINT: first(_uint16),
    Command.NAV_SPLINE_WAYPOINT: first(_uint16),
}
_PLANE_PLACED: dict[int, Codecs] = {Command.NAV_WAYPOINT: (dropped, _uint8, _uint8, dropped)}

_NOT_MEASURED = (
    *(83, 181, 182, 183, 184, 193, 194, 202, 203, 205, 206, 207, 208, 210, 211, 212, 213, 215, 216),
    *(217, 218, 222, 223, 531, 532, 534, 600, 601, 1000, 2000, 2001, 2500, 2501, 3000, 42_600),
    *(42_702, 42_703),
)
_UNPLACED: dict[int, Codecs] = {
    Command.NAV_RETURN_TO_LAUNCH: NOTHING,
    Command.NAV_DELAY: (single, _int8, _int8, _int8),
    Command.CONDITION_DELAY: first(single),
    Command.CONDITION_DISTANCE: first(single),
    Command.CONDITION_YAW: (single, single, _int8, _uint8),
    Command.DO_JUMP: (_uint16, _int16, dropped, dropped),
    Command.DO_CHANGE_SPEED: (_uint8, single, single, dropped),
    Command.DO_SET_ROI_NONE: NOTHING,
    **dict.fromkeys(_NOT_MEASURED, UNKNOWN),
}

_SEA, _HOME, _TERRAIN = Frame.GLOBAL, Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_TERRAIN_ALT
_FRAMES = {0: _SEA, 2: _SEA, 3: _HOME, 5: _SEA, 6: _HOME, 10: _TERRAIN, 11: _TERRAIN}

_YAW = dict.fromkeys(
    (Command.NAV_WAYPOINT, Command.NAV_LAND, Command.NAV_TAKEOFF, Command.NAV_VTOL_TAKEOFF), (3,)
)

_COPTER_SPEEDS: dict[float, SpeedAxis] = dict(
    enumerate(("horizontal", "horizontal", "climb", "descent"))
)
_PLANE_SPEEDS: dict[float, SpeedAxis] = {0: "airspeed", 1: "least ground speed"}
_PLANE_DEFAULT = -2.0  # The airspeed of a DO_CHANGE_SPEED that stands for the plane's own, m/s.


def _speed_change(item: MissionItem, axes: Mapping[float, SpeedAxis]) -> SpeedChange | None:
    axis, speed = axes.get(_uint8(item.params[0])), item.params[1]
    if axis == "airspeed" and speed == _PLANE_DEFAULT:
        return SpeedChange(axis, None)
    return SpeedChange(axis, speed) if axis is not None and speed > 0 else None


def _dialect(
    name: str, own: dict[int, Codecs], most: int, axes: Mapping[float, SpeedAxis]
) -> Dialect:
    return Dialect(
        name=name,
        home_row=True,
        items=Limit(650, most),  # 655 in simulation
        jumps=Limit(15, 100),
        fence_rows=84,
        rally_rows=10,
        atomic=False,
        unset_is_zero=True,
        zero_means_here=True,
        placed=_PLACED | own,
        unplaced=_UNPLACED,
        frames=_FRAMES,
        idle_frames=dict.fromkeys(range(256), Frame.GLOBAL),
        may_be_unset=_YAW | {Command.NAV_VTOL_LAND: (2, 3)},
        altitude=_altitude,
        fence_altitude=dropped,
        rally_altitude=_int16,
        highest=_HIGHEST,
        always_continues=True,
        keeps_idle=False,
        speed_change=lambda item: _speed_change(item, axes),
        unlimited=lambda values: values.value("sd_storage") > 0,
        endings=LANDINGS | {Command.NAV_LOITER_UNLIM, Command.NAV_RETURN_TO_LAUNCH},
        flies_on=lambda values: bool(int(values.value("mission_options")) & _CONTINUE_AFTER_LAND),
        make_room="set BRD_SD_MISSION to store missions on the card",
    )


COPTER_DIALECT = _dialect("ArduCopter", _COPTER_PLACED, 718, _COPTER_SPEEDS)
PLANE_DIALECT = _dialect("ArduPlane", _PLANE_PLACED, 724, _PLANE_SPEEDS)
