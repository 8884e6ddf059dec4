"""ArduCopter and ArduPlane: items are squeezed into 15 bytes each."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from faao_mav.autopilot.dialect import (
    BESIDE,
    NOTHING,
    Codecs,
    Dialect,
    Limit,
    SpeedAxis,
    SpeedChange,
    degrees,
    dropped,
    first,
    flag,
    misplaced,
    name_of,
    single,
    through,
    whole,
)
from faao_mav.mission.command import (
    ABOVE_HOME,
    ABOVE_SEA,
    ABOVE_TERRAIN,
    FLOWN_TO,
    LANDINGS,
    RALLY_POINT,
    Command,
    Frame,
)
from faao_mav.mission.item import MissionItem

_HIGHEST = 83_000.0
"""The altitude from which on items are refused, m. Read in AP_Mission."""

_CONTINUE_AFTER_LAND = 4
"""The bit of MIS_OPTIONS by which a take-off behind a landing is flown. Measured on ArduCopter 4.7:
without it the mission ends there, and with it before any other item too."""

_uint8, _uint16, _int8, _int16 = (
    whole(0, 255),
    whole(0, 65_535),
    whole(-128, 127),
    whole(-32_768, 32_767),
)


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


_COMMON: dict[int, Codecs] = {
    Command.NAV_LOITER_UNLIM: (dropped, dropped, _signed_radius, dropped),
    Command.NAV_LOITER_TURNS: (_uint8, dropped, _turning_radius, flag),
    Command.NAV_LOITER_TIME: (_uint16, dropped, _direction, flag),
    Command.NAV_RETURN_TO_LAUNCH: NOTHING,
    Command.NAV_LAND: (_uint16, dropped, dropped, _direction),
    Command.NAV_TAKEOFF: first(_uint16),
    Command.NAV_LOITER_TO_ALT: (dropped, _signed_radius, dropped, flag),
    Command.NAV_VTOL_TAKEOFF: NOTHING,
    Command.NAV_VTOL_LAND: first(_uint16),
    Command.NAV_DELAY: (single, _int8, _int8, _int8),
    Command.CONDITION_DELAY: first(single),
    Command.CONDITION_DISTANCE: first(single),
    Command.CONDITION_YAW: (single, single, _int8, _uint8),
    Command.DO_JUMP: (_uint16, _int16, dropped, dropped),
    Command.DO_CHANGE_SPEED: (_uint8, single, single, dropped),
    Command.DO_SET_HOME: first(_uint16),
    Command.DO_LAND_START: NOTHING,
    Command.DO_SET_ROI_LOCATION: NOTHING,
    Command.DO_SET_ROI_NONE: NOTHING,
    Command.DO_SET_ROI: first(_uint16),
}
_COPTER: dict[int, Codecs] = {
    Command.NAV_WAYPOINT: first(_uint16),
    Command.NAV_SPLINE_WAYPOINT: first(_uint16),
}
_PLANE: dict[int, Codecs] = {Command.NAV_WAYPOINT: (dropped, _uint8, _uint8, dropped)}

_OTHERS = frozenset(
    {30, 83, 92, 94, 181, 182, 183, 184, 188, 191, 193, 194, 202, 203, 205, 206, 207, 208, 210}
    | {211, 212, 213, 215, 216, 217, 218, 222, 223, 531, 532, 534, 600, 601, 1000, 2000, 2001}
    | {2500, 2501, 3000, 42_600, 42_702, 42_703}
)
"""Commands that are taken too; what is stored of them is not written down here."""

_PLACED = FLOWN_TO | {
    Command.DO_SET_HOME,
    Command.DO_LAND_START,
    Command.DO_SET_ROI_LOCATION,
    Command.DO_SET_ROI,
    *(30, 92, 94, 188, 191),
}
"""Commands that are stored with a place; the others come back at 0, 0, 0 in frame 0."""

_FRAMES = ABOVE_SEA | ABOVE_HOME | ABOVE_TERRAIN | {Frame.MISSION}

_MAY_BE_NAN: dict[int, frozenset[int]] = {
    Command.NAV_WAYPOINT: frozenset({3}),
    Command.NAV_LAND: frozenset({3}),
    Command.NAV_TAKEOFF: frozenset({3}),
    Command.NAV_VTOL_TAKEOFF: frozenset({3}),
    Command.NAV_VTOL_LAND: frozenset({2, 3}),
}
"""Parameters, counted from 0, that may be "not set"."""

_COPTER_SPEEDS: dict[float, SpeedAxis] = {
    0: "horizontal",
    1: "horizontal",
    2: "climb",
    3: "descent",
}
_PLANE_SPEEDS: dict[float, SpeedAxis] = {0: "airspeed", 1: "least ground speed"}
_PLANE_DEFAULT = -2.0
"""The airspeed of a DO_CHANGE_SPEED that stands for the plane's own, m/s."""


def _refusal(item: MissionItem, known: dict[int, Codecs], kind: str) -> str | None:
    if item.command not in known and item.command not in _OTHERS:
        return f"{kind} does not support {name_of(item.command)} in missions"
    allowed = _MAY_BE_NAN.get(item.command, frozenset())
    for index, value in enumerate(item.params):
        if math.isnan(value) and index not in allowed:
            return f"{kind} takes no NaN in param{index + 1} of {name_of(item.command)}; give 0"
    if item.command not in _PLACED:
        return None
    if item.frame not in _FRAMES:
        return (
            f"{kind} does not support frame {item.frame} for {name_of(item.command)}; "
            f"give one of {', '.join(map(str, sorted(map(int, _FRAMES))))}"
        )
    if (wrong := misplaced(item)) is not None:
        name, value, limit = wrong
        return f"{kind} takes no {name} {value:g}; give degrees within {limit}"
    if not abs(item.z) < _HIGHEST:
        return f"{kind} takes no altitude {item.z:g}; give metres below {_HIGHEST:g}"
    return None


def _stored(item: MissionItem, known: dict[int, Codecs]) -> MissionItem:
    if item.command in BESIDE:
        return _stored_beside(item)
    codecs = known.get(item.command)
    result = replace(item, autocontinue=True)
    if codecs is not None:
        result = through(codecs, result)
    if item.command in _PLACED:
        frame = _frame(item)
        within = min(max(item.z, -_HIGHEST), _HIGHEST)
        centimetres = int(np.float32(within) * np.float32(100))
        altitude = float(np.float32(centimetres) * np.float32(0.01))
        return replace(result, frame=frame, x=degrees(item.x), y=degrees(item.y), z=altitude)
    if codecs is not None or item.frame == Frame.MISSION:
        return replace(result, frame=Frame.GLOBAL, x=0.0, y=0.0, z=0.0)
    return replace(result, frame=Frame.GLOBAL)


def _copter_speed(item: MissionItem) -> SpeedChange | None:
    axis, speed = _COPTER_SPEEDS.get(_uint8(item.params[0])), item.params[1]
    return SpeedChange(axis, speed) if axis is not None and speed > 0 else None


def _plane_speed(item: MissionItem) -> SpeedChange | None:
    axis, speed = _PLANE_SPEEDS.get(_uint8(item.params[0])), item.params[1]
    if axis is None:
        return None
    if axis == "airspeed" and speed == _PLANE_DEFAULT:
        return SpeedChange(axis, None)
    return SpeedChange(axis, speed) if speed > 0 else None


def _stored_beside(item: MissionItem) -> MissionItem:
    """A rally point has whole metres of altitude, a row of the fence has none."""
    flat = item.command != RALLY_POINT
    return replace(
        through(BESIDE[item.command], item),
        frame=Frame.GLOBAL if flat else _frame(item),
        z=0.0 if flat else _int16(item.z),
        autocontinue=False,
    )


def _frame(item: MissionItem) -> Frame:
    """Return the frame in which a place is read back: what its altitude counts from."""
    if item.frame in ABOVE_HOME:
        return Frame.GLOBAL_RELATIVE_ALT
    return Frame.GLOBAL_TERRAIN_ALT if item.frame in ABOVE_TERRAIN else Frame.GLOBAL


def _dialect(
    name: str,
    own: dict[int, Codecs],
    most: int,
    speed_change: Callable[[MissionItem], SpeedChange | None],
) -> Dialect:
    known = _COMMON | own
    return Dialect(
        home_row=True,
        items=Limit(650, most),  # 655 in simulation
        jumps=Limit(15, 100),
        fence_rows=84,
        rally_rows=10,
        atomic=False,
        unset_is_zero=True,
        zero_means_here=True,
        placed_in_mission_frame=True,
        refusal=lambda item: _refusal(item, known, name),
        stored=lambda item: _stored(item, known),
        speed_change=speed_change,
        unlimited=lambda values: values.value("sd_storage") > 0,
        endings=LANDINGS | {Command.NAV_LOITER_UNLIM, Command.NAV_RETURN_TO_LAUNCH},
        flies_on=lambda values: bool(int(values.value("mission_options")) & _CONTINUE_AFTER_LAND),
        make_room="set BRD_SD_MISSION to store missions on the card",
        known=frozenset(known),
    )


COPTER_DIALECT = _dialect("ArduCopter", _COPTER, 718, _copter_speed)
PLANE_DIALECT = _dialect("ArduPlane", _PLANE, 724, _plane_speed)
