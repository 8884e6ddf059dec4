"""ArduCopter: what it is, and how it flies a mission."""

import math

from faao_mav.autopilot.ardupilot import ardupilot_type, at_fence
from faao_mav.autopilot.ardupilot.copter.flight_model import ArduCopter as ArduCopter
from faao_mav.autopilot.ardupilot.copter.parameters import TABLE
from faao_mav.autopilot.ardupilot.dialect import COPTER_DIALECT
from faao_mav.autopilot.body import ARDUCOPTER_BODY
from faao_mav.autopilot.failsafe import failsafes
from faao_mav.autopilot.manners import Modes
from faao_mav.autopilot.orbit import Orbit
from faao_mav.autopilot.parameter import ParameterValues, Recommended
from faao_mav.mission.command import Command
from faao_mav.mission.item import MissionItem

_JERK, _LIVELIEST_JERK = 10.0, 20.0
"""The recommended jerk, m/s³, and the one for bends at speed, with the greatest acceleration: its
documented maximum. Measured, flown and planned, m rms, on a plan with free ends at 10 m/s: 1.5,
with a jerk of 10 4.4."""

_BRAKE = 17
_MODES = Modes(
    rest=0,
    mission=3,
    hold=_BRAKE,
    at_fence={"return": 6, "land": 9, "hold": _BRAKE},
    guided=4,
    not_to_arm_in=frozenset({6, 7, 9, 14, 15, _BRAKE, 18, 21, 27}),
)
"""COPTER_MODE of MAVLink. ArduCopter 4.7 does not arm in RTL, CIRCLE, LAND, FLIP, AUTOTUNE, BRAKE,
SMART_RTL and AUTO_RTL (in AUTO as AUTO_OPTIONS says), and takes off when thrown in THROW."""


def _orbit(vehicle: ParameterValues, item: MissionItem) -> Orbit | None:
    """Return how a NAV_LOITER_TURNS is flown (AC_Circle), turning by half of the acceleration.

    Negative radii turn left, and without one a negative CIRCLE_RATE does.
    """
    if item.command != Command.NAV_LOITER_TURNS:
        return None
    given, rate = item.params[2], vehicle.value("circle_rate")
    told = math.isfinite(given) and given != 0
    radius = abs(given) if told else vehicle.value("circle_radius")
    turns = item.params[0] if math.isfinite(item.params[0]) else 0.0
    if radius <= 0 or rate == 0:
        return None
    most = math.sqrt(vehicle.value("acceleration") / (2 * radius))
    return Orbit(
        radius,
        given > 0 if told else rate > 0,
        turns=max(turns, 0.0),
        turn_rate=min(abs(rate), most),
    )


ARDUCOPTER = ardupilot_type(
    kind="copter",
    name="ArduCopter",
    mav_types=(2, 3, 4, 13, 14, 15, 29, 35),
    modes=_MODES,
    hovers=True,
    parameters=TABLE,
    dialect=COPTER_DIALECT,
    whole_second_holds=True,
    at_fence=at_fence({0: "report", 2: "land", 4: "hold"}),
    failsafes=failsafes("arducopter"),
    flight_model=ArduCopter.from_vehicle,
    recommendation=Recommended(4.0, (0.5, 5.0), {"jerk": _JERK}, {"jerk": _LIVELIEST_JERK}),
    ceilings={"max_acceleration": ("lean_angle", "acceleration")},
    body=ARDUCOPTER_BODY,
    orbits=_orbit,
)
"""ArduCopter 4.1 and later; measured on 4.7."""
