"""Items that ArduPilot accepts and then flies in a way that nobody expects."""

from collections.abc import Iterator
from itertools import pairwise

from faao_mav.mission.command import Command
from faao_mav.validate import parameters
from faao_mav.validate.case import NAV_LAST, Case, at_zero, number
from faao_mav.validate.finding import Level
from faao_mav.validate.rule import Issue, Rules
from faao_mav.vehicle.dialects import speed_change

RULES = Rules()

_WAYPOINTS = (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT)
_HORIZONTAL = (0, 1)

# Lean in degrees and the top speed that it gave, m/s: a quadrotor of ArduPilot's simulator.
_LEAN = ((30.0, 10.3), (45.0, 15.2))


@RULES.add(
    "ardupilot-spline-delay",
    Level.ERROR,
    "a NAV_DELAY after a spline waypoint: the aircraft may plunge",
    "measured on ArduCopter 4.7: from 30 m to 12 m and to 79 m in 8 of 8 flights",
    autopilot="ardupilot",
    kind="copter",
)
def _spline_delay(case: Case) -> Iterator[Issue]:
    flying = [(k, item) for k, item in enumerate(case.items) if item.command <= NAV_LAST]
    for (before, first), (index, second) in pairwise(flying):
        if (first.command, second.command) == (Command.NAV_SPLINE_WAYPOINT, Command.NAV_DELAY):
            yield Issue(
                index,
                f"the delay follows the spline waypoint {number(before)}: the autopilot reads its "
                "bytes as the spline's next point and may plunge or climb",
                f"make item {number(before)} a plain waypoint, or give it a hold in whole seconds",
            )


@RULES.add(
    "ardupilot-stays",
    Level.WARNING,
    "ArduPilot takes a waypoint at latitude and longitude 0 for the place where it is",
    "ArduPilot 4.7 ModeAuto::loc_from_cmd, Plane::set_next_WP",
    autopilot="ardupilot",
)
def _stays(case: Case) -> Iterator[Issue]:
    for index, item in case.each(*_WAYPOINTS):
        if at_zero(item):
            yield Issue(
                index,
                "latitude and longitude are 0: the aircraft stays where it is",
                "give the coordinates, or remove the item",
            )


@RULES.add(
    "ardupilot-speed-ignored",
    Level.WARNING,
    "ArduPilot does nothing on this DO_CHANGE_SPEED",
    "measured on ArduCopter 4.7; ArduPlane 4.7 Plane::do_change_speed",
    autopilot="ardupilot",
)
def _speed_ignored(case: Case) -> Iterator[Issue]:
    for index, item in case.each(Command.DO_CHANGE_SPEED):
        throttle = item.params[2] if case.vehicle.kind == "plane" else 0.0
        if speed_change(item, case.vehicle) is None and not throttle > 0:
            yield Issue(
                index,
                f"speed type {item.params[0]:g} with {item.params[1]:g} m/s does nothing: the "
                "speed before stays in force",
                "give type 0 in param1 and a speed above 0 in param2, or remove the item",
            )


@RULES.add(
    "ardupilot-speed-lean",
    Level.WARNING,
    "faster than a copter flies at its lean limit",
    "measured: 10.3 m/s at 30 degrees, 15.2 m/s at 45 (quadrotor of ArduPilot's simulator)",
    autopilot="ardupilot",
    kind="copter",
)
def _speed_lean(case: Case) -> Iterator[Issue]:
    lean = parameters.COPTER_LEAN
    angle = lean.of(case.vehicle)
    (a0, v0), (a1, v1) = _LEAN
    top = max(v0 + (angle - a0) * (v1 - v0) / (a1 - a0), 0.0)
    for index, item in case.each(Command.DO_CHANGE_SPEED):
        kind, speed = item.params[:2]
        if kind in _HORIZONTAL and speed > top:
            yield Issue(
                index,
                f"{speed:g} m/s; with a lean of at most {angle:g} degrees "
                f"({lean.name(case.vehicle)}) ArduPilot's simulated quadrotor reaches {top:.1f}",
                f"ask for {top:.1f} m/s or less, or set {lean.names[-1][0]} if your aircraft can "
                "lean more",
            )


@RULES.add(
    "ardupilot-plane-speed",
    Level.WARNING,
    "an airspeed outside what ArduPlane allows is not flown",
    "ArduPlane 4.7 Plane::do_change_speed",
    autopilot="ardupilot",
    kind="plane",
)
def _plane_speed(case: Case) -> Iterator[Issue]:
    least = parameters.PLANE_LEAST_SPEED.of(case.vehicle)
    top = parameters.PLANE_TOP_SPEED.of(case.vehicle)
    for index, item in case.each(Command.DO_CHANGE_SPEED):
        kind, speed = item.params[:2]
        if kind == 0 and speed > 0 and not least <= speed <= top:
            yield Issue(
                index,
                f"an airspeed of {speed:g} m/s; the plane flies {least:g} to {top:g} m/s "
                "(AIRSPEED_MIN, AIRSPEED_MAX) and ignores others",
                "ask for a speed in between",
            )
