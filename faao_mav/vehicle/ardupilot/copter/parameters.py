"""ArduCopter's parameters: names of 4.8 and later (SI units) first, those before it (cm) second."""

from math import radians

from faao_mav.vehicle.ardupilot.parameters import SHARED, SOURCE, rally_limit, switch
from faao_mav.vehicle.parameter import Parameter, table


def _parameter(
    key: str,
    unit: str,
    default: float,
    new: str,
    old: str,
    factor: float = 0.01,
    least: float = 0.1,
    documented: tuple[float, float] | None = None,
) -> Parameter:
    names = {new: 1.0, old: factor}
    if documented is None:
        return Parameter(key, unit, default, names, least, source=SOURCE)
    return Parameter(key, unit, default, names, least, documented=documented, source=SOURCE)


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
    _parameter("position_gain", "1/s", 1.0, "PSC_NE_POS_P", "PSC_POSXY_P", 1.0),
    _parameter("velocity_gain", "1/s", 2.0, "PSC_NE_VEL_P", "PSC_VELXY_P", 1.0),
    _parameter("velocity_integral", "1/s^2", 1.0, "PSC_NE_VEL_I", "PSC_VELXY_I", 1.0, 0.0),
    _parameter("landing_speed", "m/s", 0.5, "LAND_SPD_MS", "LAND_SPEED", least=0.05),
    _parameter("return_height", "m", 15.0, "RTL_ALT_M", "RTL_ALT", least=0.0),
    *SHARED,
    switch("fence_type", 7, "FENCE_TYPE"),
    rally_limit(300.0),
)
"""ArduCopter's parameters. A `corner_acceleration` of 0 stands for twice `acceleration`."""
