"""What autopilots keep of the items that they accept.

ArduPilot packs an item into 15 bytes, PX4 into a struct of its own: both accept fields that they
then drop. Sources: measured with ArduCopter 4.7.0-dev and PX4 v1.16.1-rc2.
"""

import math
from dataclasses import dataclass, replace

from faao_mav.mavlink.rows import CIRCLE, FENCE_RETURN_POINT, GLOBAL_FRAMES, POLYGON, RALLY_POINT
from faao_mav.mission.command import Frame
from faao_mav.mission.item import MissionItem, Params
from faao_mav.mission.vehicle import Vehicle

_FENCE = frozenset({*POLYGON.values(), *CIRCLE.values(), FENCE_RETURN_POINT})


@dataclass(frozen=True, slots=True)
class Kept:
    """Which of param1 to param4 a command keeps (`1` to `4`), which of them as whole numbers."""

    params: frozenset[int]
    whole: frozenset[int] = frozenset()
    place: bool = True


def _kept(params: str, whole: str = "", *, place: bool = True) -> Kept:
    return Kept(frozenset(map(int, params)), frozenset(map(int, whole)), place)


_COPTER = {
    16: _kept("1", "1"),  # waypoint: the hold, in whole seconds
    17: _kept("3", "3"),  # loiter: the radius
    18: _kept("13", "13"),  # loiter turns
    19: _kept("13", "13"),  # loiter time
    20: _kept("", place=False),  # return to launch
    21: _kept("1", "1"),  # land: abort altitude
    22: _kept("1", "1"),  # take-off: pitch
    82: _kept("1", "1"),  # spline waypoint
    93: _kept("1234", place=False),  # delay
    112: _kept("1", place=False),  # condition delay
    115: _kept("1234", place=False),  # condition yaw
    177: _kept("12", "12", place=False),  # jump
    178: _kept("123", "1", place=False),  # change speed
}
_PLANE = _COPTER | {16: _kept("23", "23")}
_PX4 = {
    16: _kept("124"),
    17: _kept("34"),
    19: _kept("1234"),
    21: _kept("124"),
    22: _kept("14"),
}


def kept_by(command: int, vehicle: Vehicle) -> Kept | None:
    """Return what `vehicle` keeps of `command`, or None where that is not known."""
    if vehicle.autopilot == "px4":
        return _PX4.get(command)
    return (_PLANE if vehicle.kind == "plane" else _COPTER).get(command)


def as_stored(item: MissionItem, vehicle: Vehicle) -> MissionItem:
    """Return `item` as `vehicle` gives it back on download.

    Dropped numbers are 0; whole numbers are cut, not rounded. Of commands that are not known here
    everything is taken to be kept.
    """
    if vehicle.autopilot == "px4":
        return _px4(item, vehicle)
    return _ardupilot(item, vehicle)


def item_limit(vehicle: Vehicle) -> int:
    """Return how many rows fit, home included: of the smallest common board.

    ArduPilot: (storage - 4) / 15 bytes, 655 in its simulator, 718 on boards with 16 kB. PX4:
    1000 on most boards.
    """
    return 1000 if vehicle.autopilot == "px4" else 655


def _ardupilot(item: MissionItem, vehicle: Vehicle) -> MissionItem:
    if item.command in _FENCE:
        altitude = item.z if item.command == FENCE_RETURN_POINT else 0.0
        return replace(item, frame=_plain_frame(item.frame), z=altitude)
    if item.command == RALLY_POINT:
        return replace(item, z=float(math.trunc(item.z)))
    kept = kept_by(item.command, vehicle)
    params = item.params if kept is None else _reduced(item.params, kept)
    placed = item.frame != Frame.MISSION if kept is None else kept.place
    if not placed:
        return MissionItem(item.command, 0, params)
    place = (_number(item.x), _number(item.y), math.trunc(round(item.z * 100, 3)) / 100)
    return MissionItem(item.command, _plain_frame(item.frame), params, *place)


def _px4(item: MissionItem, vehicle: Vehicle) -> MissionItem:
    if item.frame not in GLOBAL_FRAMES:
        return item
    frame = {0: 5, 3: 6}.get(item.frame, item.frame)
    kept = kept_by(item.command, vehicle)
    if kept is None:
        return replace(item, frame=frame)
    params = _reduced(item.params, kept)
    if 4 in kept.params:  # the yaw: NaN says "as it comes", and is kept
        params = (*params[:3], item.params[3])
    return replace(item, frame=frame, params=params)


def _reduced(params: Params, kept: Kept) -> Params:
    one, two, three, four = (
        (float(math.trunc(_number(value))) if number in kept.whole else _number(value))
        if number in kept.params
        else 0.0
        for number, value in enumerate(params, start=1)
    )
    return one, two, three, four


def _number(value: float) -> float:
    return 0.0 if math.isnan(value) else value


def _plain_frame(frame: int) -> int:
    return {5: 0, 6: 3, 11: 10}.get(frame, frame)
