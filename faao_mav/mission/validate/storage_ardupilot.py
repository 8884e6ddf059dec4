"""What ArduPilot's storage of 15 bytes an item loses."""

import math
from collections.abc import Iterator

from faao_mav.mission.command import FLOWN_TO, Command
from faao_mav.mission.validate.case import Case
from faao_mav.mission.validate.finding import Level
from faao_mav.mission.validate.rule import Issue, Rules

RULES = Rules()

_SOURCE = "ArduPilot 4.7 AP_Mission::mavlink_int_to_mission_cmd; measured"
_HELD = (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT, Command.NAV_LOITER_TIME)
_LONGEST_HOLD = 65_535
_GREATEST_RADIUS = 255


@RULES.add(
    "ardupilot-whole-seconds",
    Level.WARNING,
    "ArduPilot keeps the whole seconds of a hold",
    _SOURCE,
    autopilot="ardupilot",
    kind="copter",
)
def _whole_seconds(case: Case) -> Iterator[Issue]:
    for index, item in case.each(*_HELD):
        hold = item.params[0]
        if 0 < hold <= _LONGEST_HOLD and hold != math.floor(hold):
            yield Issue(
                index,
                f"a hold of {hold:g} s is stored as {math.floor(hold)} s",
                "use whole seconds; for fractions put a NAV_DELAY after a plain waypoint",
            )


@RULES.add(
    "ardupilot-hold-range",
    Level.ERROR,
    "a hold is negative or too long to be stored",
    _SOURCE,
    autopilot="ardupilot",
    kind="copter",
)
def _hold_range(case: Case) -> Iterator[Issue]:
    for index, item in case.each(*_HELD):
        hold = item.params[0]
        if hold < 0 or hold > _LONGEST_HOLD:
            yield Issue(
                index,
                f"a hold of {hold:g} s wraps around in 16 bits; 0 to {_LONGEST_HOLD} s can be kept",
                "correct param1, seconds",
            )


@RULES.add(
    "ardupilot-drops-radius",
    Level.NOTE,
    "ArduCopter does not store a waypoint's acceptance or pass-by radius",
    _SOURCE,
    autopilot="ardupilot",
    kind="copter",
)
def _drops_radius(case: Case) -> Iterator[Issue]:
    for index, item in case.each(Command.NAV_WAYPOINT):
        radius, pass_by = item.params[1], item.params[2]
        if radius > 0 or abs(pass_by) > 0:
            name, value = ("acceptance", radius) if radius > 0 else ("pass-by", pass_by)
            yield Issue(
                index,
                f"the {name} radius of {value:g} m is not stored",
                "set WPNAV_RADIUS (WP_RADIUS_M), which holds for all waypoints",
            )


@RULES.add(
    "ardupilot-drops-yaw",
    Level.NOTE,
    "ArduPilot does not store a waypoint's yaw",
    _SOURCE,
    autopilot="ardupilot",
)
def _drops_yaw(case: Case) -> Iterator[Issue]:
    for index, item in case.each(Command.NAV_WAYPOINT):
        if abs(item.params[3]) > 0:
            yield Issue(
                index,
                f"the yaw of {item.params[3]:g} degrees is not stored",
                "put a CONDITION_YAW before the waypoint"
                if case.vehicle.kind == "copter"
                else "write 0: a plane flies where it points",
            )


@RULES.add(
    "ardupilot-plane-radius",
    Level.WARNING,
    "ArduPlane stores radii of waypoints as whole metres up to 255",
    _SOURCE,
    autopilot="ardupilot",
    kind="plane",
)
def _plane_radius(case: Case) -> Iterator[Issue]:
    for index, item in case.each(Command.NAV_WAYPOINT):
        for name, value in (("acceptance", item.params[1]), ("pass-by", item.params[2])):
            stored = min(max(value, 0.0), float(_GREATEST_RADIUS))
            stored = math.floor(stored) if math.isfinite(stored) else 0
            if math.isfinite(value) and stored != value:
                yield Issue(
                    index,
                    f"the {name} radius of {value:g} m is stored as {stored:g} m",
                    f"use whole metres from 0 to {_GREATEST_RADIUS}",
                )


@RULES.add(
    "ardupilot-plane-hold",
    Level.WARNING,
    "ArduPlane does not store a waypoint's hold",
    _SOURCE,
    autopilot="ardupilot",
    kind="plane",
)
def _plane_hold(case: Case) -> Iterator[Issue]:
    for index, item in case.each(Command.NAV_WAYPOINT):
        if item.params[0] > 0:
            yield Issue(
                index,
                f"the hold of {item.params[0]:g} s is not stored: a plane flies on",
                "use NAV_LOITER_TIME to wait in a circle",
            )


@RULES.add(
    "ardupilot-centimetres",
    Level.NOTE,
    "ArduPilot stores altitudes in whole centimetres",
    _SOURCE,
    autopilot="ardupilot",
)
def _centimetres(case: Case) -> Iterator[Issue]:
    odd = [
        index
        for index, item in case.each(*FLOWN_TO)
        if abs(item.z) < 83_000 and abs(100 * item.z - round(100 * item.z)) > 0.01
    ]
    if odd:
        z = case.items[odd[0]].z
        yield Issue(
            odd[0],
            f"the altitude of {z:g} m is cut to {math.trunc(100 * z) / 100:g} m, and so in "
            f"{len(odd)} items in all",
            "nothing, unless centimetres matter",
        )
