"""ArduCopter's parameters: the newer names (SI units) first, those up to 4.7 (cm) second."""

import math
from dataclasses import dataclass, replace
from math import radians
from typing import Self

from faao_mav.autopilot.ardupilot import DEGREE, SHARED, SOURCE, rally_parameters, switch
from faao_mav.autopilot.body import ARDUCOPTER_BODY, CopterBody
from faao_mav.autopilot.parameter import Parameter, ParameterRecord, ParameterValues, table
from faao_mav.autopilot.vehicle_type import lean_acceleration
from faao_mav.power import GRAVITY


def _parameter(
    key: str,
    unit: str,
    default: float,
    new: str,
    old: str,
    factor: float = 0.01,
    least: float = 0.1,
    documented: tuple[float, float] = (-math.inf, math.inf),
    motion: bool = True,
) -> Parameter:
    names = {new: 1.0, old: factor}
    return Parameter(
        key, unit, default, names, least, documented=documented, source=SOURCE, motion=motion
    )


def _attitude(key: str, unit: str, degrees: float, new: str, old: str) -> Parameter:
    names = {new: radians(1), old: radians(0.01)}
    return Parameter(key, unit, radians(degrees), names, 0.0, source=SOURCE)


TABLE = table(
    _parameter("cruise_speed", "m/s", 10.0, "WP_SPD", "WPNAV_SPEED"),
    _parameter("climb_speed", "m/s", 2.5, "WP_SPD_UP", "WPNAV_SPEED_UP"),
    _parameter("descent_speed", "m/s", 1.5, "WP_SPD_DN", "WPNAV_SPEED_DN"),
    _parameter("acceleration", "m/s^2", 2.5, "WP_ACC", "WPNAV_ACCEL", documented=(0.5, 5.0)),
    _parameter("climb_acceleration", "m/s^2", 1.0, "WP_ACC_Z", "WPNAV_ACCEL_Z"),
    _parameter("corner_acceleration", "m/s^2", 0.0, "WP_ACC_CNR", "WPNAV_ACCEL_C", least=0.0),
    _parameter("jerk", "m/s^3", 1.0, "WP_JERK", "WPNAV_JERK", 1.0),
    _parameter("radius", "m", 2.0, "WP_RADIUS_M", "WPNAV_RADIUS", least=0.05),
    Parameter(
        "lean_angle",
        "rad",
        radians(30),
        {"ATC_ANGLE_MAX": radians(1), "ANGLE_MAX": radians(0.01)},
        radians(5),
        radians(85),
        source=SOURCE,
    ),
    Parameter("input_time", "s", 0.15, {"ATC_INPUT_TC": 1.0}, 0.0, source=SOURCE),
    _attitude("roll_acceleration", "rad/s^2", 1100, "ATC_ACC_R_MAX", "ATC_ACCEL_R_MAX"),
    _attitude("pitch_acceleration", "rad/s^2", 1100, "ATC_ACC_P_MAX", "ATC_ACCEL_P_MAX"),
    _parameter("position_gain", "1/s", 1.0, "PSC_NE_POS_P", "PSC_POSXY_P", 1.0),
    _parameter("velocity_gain", "1/s", 2.0, "PSC_NE_VEL_P", "PSC_VELXY_P", 1.0),
    _parameter("velocity_integral", "1/s^2", 1.0, "PSC_NE_VEL_I", "PSC_VELXY_I", 1.0, 0.0),
    _parameter("landing_speed", "m/s", 0.5, "LAND_SPD_MS", "LAND_SPEED", least=0.05),
    _parameter("return_height", "m", 15.0, "RTL_ALT_M", "RTL_ALT", least=0.0, motion=False),
    *SHARED,
    switch("fence_options", 0, "FENCE_OPTIONS"),
    switch("fence_type", 7, "FENCE_TYPE"),
    _parameter("circle_radius", "m", 10.0, "CIRCLE_RADIUS_M", "CIRCLE_RADIUS", least=0.0),
    Parameter("circle_rate", "rad/s", radians(20), {"CIRCLE_RATE": radians(1)}, source=SOURCE),
    *rally_parameters(limit=300.0, home=1),
)
"""ArduCopter's parameters. A `corner_acceleration` of 0 stands for twice `acceleration`."""


_LEAST_INPUT_TIME = 0.1
"""The autopilot's own lower bound of ATC_INPUT_TC, s."""


@dataclass(frozen=True, slots=True)
class ArduCopterLimits(ParameterRecord, table=TABLE):
    """What bounds a flight of ArduCopter, in SI units: keys and defaults of `TABLE`.

    `east_metre` and `north_metre` are the autopilot's metres per metre: it takes the Earth for a
    sphere. `body` is the aircraft.
    """

    cruise_speed: float = TABLE["cruise_speed"].default
    climb_speed: float = TABLE["climb_speed"].default
    descent_speed: float = TABLE["descent_speed"].default
    acceleration: float = TABLE["acceleration"].default
    climb_acceleration: float = TABLE["climb_acceleration"].default
    corner_acceleration: float = TABLE["corner_acceleration"].default
    jerk: float = TABLE["jerk"].default
    radius: float = TABLE["radius"].default
    lean_angle: float = TABLE["lean_angle"].default
    input_time: float = TABLE["input_time"].default
    roll_acceleration: float = TABLE["roll_acceleration"].default
    pitch_acceleration: float = TABLE["pitch_acceleration"].default
    position_gain: float = TABLE["position_gain"].default
    velocity_gain: float = TABLE["velocity_gain"].default
    velocity_integral: float = TABLE["velocity_integral"].default
    east_metre: float = 1.0
    north_metre: float = 1.0
    body: CopterBody = ARDUCOPTER_BODY

    @classmethod
    def from_vehicle(cls, vehicle: ParameterValues, latitude: float | None = None) -> Self:
        """Return the values that `vehicle` has; raises `InputError` for one that is no use.

        With the `latitude` of the flight, degrees, metres are counted as the autopilot does.
        """
        limits = super(ArduCopterLimits, cls).from_vehicle(vehicle)
        if latitude is None:
            return limits
        east, north = _metres(latitude)
        return replace(limits, east_metre=east, north_metre=north)

    @property
    def rise(self) -> float:
        """t_j: how long the jerk takes to rise, s: twice ATC_INPUT_TC, or what leaning allows."""
        agility = min(self.roll_acceleration or math.inf, self.pitch_acceleration or math.inf)
        return max(
            2 * max(self.input_time, _LEAST_INPUT_TIME), math.pi * self.jerk / (GRAVITY * agility)
        )

    def farthest(self, speed: float) -> float:
        """Return the error, m, at which the position controller asks for a correction at `speed`.

        With the gain k and the acceleration A that is v / k, from v = A / k on v²/2A + A/2k²: of an
        error farther than that of the commanded speed no more is made.
        """
        gain, most = self.position_gain, self.acceleration
        if speed <= most / gain:
            return speed / gain
        return speed**2 / (2 * most) + most / (2 * gain**2)

    @property
    def corner(self) -> float:
        """The greatest acceleration in a corner, m/s²."""
        return self.corner_acceleration or 2 * self.acceleration

    @property
    def lean(self) -> float:
        """The acceleration at the largest lean angle, m/s²."""
        return lean_acceleration(self.lean_angle)


def _metres(latitude: float) -> tuple[float, float]:
    """The autopilot's metres per metre of WGS84 at `latitude` degrees, east and north."""
    a, e2 = 6_378_137.0, 6.69437999014e-3
    w = 1 - e2 * math.sin(math.radians(latitude)) ** 2
    degree = math.pi / 180 * a / math.sqrt(w)
    return DEGREE / degree, DEGREE * w / (degree * (1 - e2))
