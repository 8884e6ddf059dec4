"""ArduCopter's parameters: the newer names (SI units) first, those up to 4.7 (cm) second.

Source: ArduPilot 4.7, parameter list of Copter.
"""

import math
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot.ardupilot import ARDUPILOT, SHARED
from faao_mav.autopilot.body import ARDUCOPTER_BODY, CopterBody
from faao_mav.autopilot.model import Model, parameter
from faao_mav.autopilot.parameter import Parameter, row, rule, table
from faao_mav.autopilot.vehicle_type import lean_acceleration
from faao_mav.geodesy import LocalFrame
from faao_mav.power import GRAVITY

_LEAST_INPUT_TIME = 0.1
"""The autopilot's own lower bound of ATC_INPUT_TC, s."""


@dataclass(frozen=True, slots=True)
class ArduCopterLimits(Model):
    """What bounds a flight of ArduCopter, in SI units.

    A `corner_acceleration` of 0 stands for twice `acceleration`. `latitude` is that of the flight,
    degrees, None where metres are the autopilot's, which takes the Earth for a sphere. `body` is
    the aircraft.
    """

    cruise_speed: float = parameter("m/s", 10.0, "WP_SPD", "WPNAV_SPEED")
    climb_speed: float = parameter("m/s", 2.5, "WP_SPD_UP", "WPNAV_SPEED_UP")
    descent_speed: float = parameter("m/s", 1.5, "WP_SPD_DN", "WPNAV_SPEED_DN")
    acceleration: float = parameter("m/s^2", 2.5, "WP_ACC", "WPNAV_ACCEL")
    climb_acceleration: float = parameter("m/s^2", 1.0, "WP_ACC_Z", "WPNAV_ACCEL_Z")
    corner_acceleration: float = parameter("m/s^2", 0.0, "WP_ACC_CNR", "WPNAV_ACCEL_C", least=0.0)
    jerk: float = parameter("m/s^3", 1.0, "WP_JERK", "WPNAV_JERK", 1.0)
    radius: float = parameter("m", 2.0, "WP_RADIUS_M", "WPNAV_RADIUS", least=0.05)
    lean_angle: float = parameter("rad", 30, "ATC_ANGLE_MAX", "ANGLE_MAX", least=5, greatest=85)
    input_time: float = parameter("s", 0.15, "ATC_INPUT_TC", least=0.0)
    roll_acceleration: float = parameter(
        "rad/s^2", 1100, "ATC_ACC_R_MAX", "ATC_ACCEL_R_MAX", least=0.0
    )
    pitch_acceleration: float = parameter(
        "rad/s^2", 1100, "ATC_ACC_P_MAX", "ATC_ACCEL_P_MAX", least=0.0
    )
    position_gain: float = parameter("1/s", 1.0, "PSC_NE_POS_P", "PSC_POSXY_P", 1.0)
    velocity_gain: float = parameter("1/s", 2.0, "PSC_NE_VEL_P", "PSC_VELXY_P", 1.0)
    velocity_integral: float = parameter("1/s^2", 1.0, "PSC_NE_VEL_I", "PSC_VELXY_I", 1.0, least=0)
    latitude: float | None = None
    body: CopterBody = ARDUCOPTER_BODY

    @property
    def scale(self) -> Real:
        """The autopilot's metres per metre, east, north and up, (3,)."""
        if self.latitude is None:
            return np.ones(3)
        there = LocalFrame(self.latitude, 0.0).to_geodetic([1.0, 1.0])
        return np.append(ARDUPILOT.local_frame(self.latitude, 0.0).to_local(*there), 1.0)

    @property
    def rise(self) -> float:
        """t_j: how long the jerk takes to rise, s: twice ATC_INPUT_TC, or what leaning allows."""
        agility = min(self.roll_acceleration or math.inf, self.pitch_acceleration or math.inf)
        return max(
            2 * max(self.input_time, _LEAST_INPUT_TIME), math.pi * self.jerk / (GRAVITY * agility)
        )

    @property
    def corner(self) -> float:
        """The greatest acceleration in a corner, m/s²."""
        return self.corner_acceleration or 2 * self.acceleration

    @property
    def lean(self) -> float:
        """The acceleration at the largest lean angle, m/s²."""
        return lean_acceleration(self.lean_angle)


TABLE = table(
    *ArduCopterLimits.parameters(),
    row("landing_speed", "m/s", 0.5, "LAND_SPD_MS", "LAND_SPEED", least=0.05),
    row("return_height", "m", 15.0, "RTL_ALT_M", "RTL_ALT", least=0.0, motion=False),
    *SHARED,
    rule("fence_options", 0, "FENCE_OPTIONS"),
    rule("fence_type", 7, "FENCE_TYPE"),
    row("circle_radius", "m", 10.0, "CIRCLE_RADIUS_M", "CIRCLE_RADIUS", least=0.0),
    row("circle_rate", "rad/s", 20, "CIRCLE_RATE", least=-math.inf),
    Parameter("rally_limit", "m", 300.0, {"RALLY_LIMIT_KM": 1000.0}, motion=False),
    rule("rally_home", 1, "RALLY_INCL_HOME"),
)
"""ArduCopter's parameters."""
