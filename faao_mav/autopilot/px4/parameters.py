"""PX4's parameters, of its multicopters and of its planes."""

from dataclasses import dataclass
from functools import partial
from math import inf, radians

from faao_mav.autopilot.body import PX4_BODY, CopterBody
from faao_mav.autopilot.parameter import Parameter, ParameterRecord, table

_SOURCE = "PX4 1.16: parameter reference"


def _parameter(
    key: str,
    unit: str,
    default: float,
    name: str,
    least: float = -inf,
    greatest: float = inf,
    factor: float = 1.0,
    capped_by: str = "",
    documented: tuple[float, float] = (-inf, inf),
    motion: bool = True,
) -> Parameter:
    return Parameter(
        key,
        unit,
        default,
        {name: factor},
        least,
        greatest,
        capped_by=capped_by,
        documented=documented,
        source=_SOURCE,
        motion=motion,
    )


_rule = partial(_parameter, motion=False)


_SHARED = (
    _rule("takeoff_land_required", "", 0, "MIS_TKO_LAND_REQ"),
    _rule("first_waypoint_distance", "m", 10_000.0, "MIS_DIST_1WP"),
    _rule("takeoff_height", "m", 2.5, "MIS_TAKEOFF_ALT"),
    _rule("fence_action", "", 2, "GF_ACTION"),
    _rule("fence_predict", "", 0, "GF_PREDICT"),
    _rule("fence_distance", "m", 0.0, "GF_MAX_HOR_DIST"),
    _rule("fence_height", "m", 0.0, "GF_MAX_VER_DIST"),
    _rule("return_height", "m", 60.0, "RTL_RETURN_ALT", 0.0),
    _rule("return_type", "", 0, "RTL_TYPE"),
)
"""Mission checks, fence and return."""

COPTER_TABLE = table(
    _parameter("cruise_speed", "m/s", 5.0, "MPC_XY_CRUISE", 0.1, capped_by="max_speed"),
    _parameter("max_speed", "m/s", 12.0, "MPC_XY_VEL_MAX", 0.1),
    _parameter("acceleration", "m/s^2", 3.0, "MPC_ACC_HOR", 0.1, documented=(2.0, 15.0)),
    _parameter("greatest_acceleration", "m/s^2", 5.0, "MPC_ACC_HOR_MAX", 0.1),
    _parameter("jerk", "m/s^3", 4.0, "MPC_JERK_AUTO", 0.1),
    _parameter(
        "lean_angle", "rad", radians(45), "MPC_TILTMAX_AIR", radians(20), radians(89), radians(1)
    ),
    _parameter("corner_gain", "1/s", 0.5, "MPC_XY_TRAJ_P", 0.01),
    _parameter("error_limit", "m", 2.0, "MPC_XY_ERR_MAX", 0.1),
    _parameter("acceptance_radius", "m", 2.0, "NAV_ACC_RAD", 0.05),
    _parameter("height_radius", "m", 0.8, "NAV_MC_ALT_RAD", 0.05),
    _parameter("climb_speed", "m/s", 3.0, "MPC_Z_V_AUTO_UP", 0.1, capped_by="max_climb_speed"),
    _parameter("max_climb_speed", "m/s", 3.0, "MPC_Z_VEL_MAX_UP", 0.1),
    _parameter("descent_speed", "m/s", 1.5, "MPC_Z_V_AUTO_DN", 0.1, capped_by="max_descent_speed"),
    _parameter("max_descent_speed", "m/s", 1.5, "MPC_Z_VEL_MAX_DN", 0.1),
    _parameter("climb_acceleration", "m/s^2", 4.0, "MPC_ACC_UP_MAX", 0.1),
    _parameter("descent_acceleration", "m/s^2", 3.0, "MPC_ACC_DOWN_MAX", 0.1),
    _parameter("take_off_speed", "m/s", 1.5, "MPC_TKO_SPEED", 0.1),
    _parameter("landing_speed", "m/s", 0.7, "MPC_LAND_SPEED", 0.05),
    *_SHARED,
)
"""A PX4 multicopter's parameters. In missions it climbs at MPC_Z_V_AUTO_UP, which PX4 lowers to
MPC_Z_VEL_MAX_UP (mc_pos_control, parameters_update); likewise down, and over the ground."""


@dataclass(frozen=True, slots=True)
class Px4Limits(ParameterRecord, table=COPTER_TABLE):
    """What bounds a multicopter's flight, in SI units: keys and defaults of `COPTER_TABLE`.

    `body` is the aircraft.
    """

    cruise_speed: float = COPTER_TABLE["cruise_speed"].default
    max_speed: float = COPTER_TABLE["max_speed"].default
    acceleration: float = COPTER_TABLE["acceleration"].default
    jerk: float = COPTER_TABLE["jerk"].default
    corner_gain: float = COPTER_TABLE["corner_gain"].default
    error_limit: float = COPTER_TABLE["error_limit"].default
    acceptance_radius: float = COPTER_TABLE["acceptance_radius"].default
    height_radius: float = COPTER_TABLE["height_radius"].default
    climb_speed: float = COPTER_TABLE["climb_speed"].default
    descent_speed: float = COPTER_TABLE["descent_speed"].default
    climb_acceleration: float = COPTER_TABLE["climb_acceleration"].default
    descent_acceleration: float = COPTER_TABLE["descent_acceleration"].default
    body: CopterBody = PX4_BODY


PLANE_TABLE = table(
    _parameter("cruise_speed", "m/s", 15.0, "FW_AIRSPD_TRIM", 1.0),
    _parameter("min_speed", "m/s", 10.0, "FW_AIRSPD_MIN", 1.0),
    _parameter("max_speed", "m/s", 20.0, "FW_AIRSPD_MAX", 1.0),
    _parameter("roll_limit", "rad", radians(50), "FW_R_LIM", radians(5), radians(85), radians(1)),
    _parameter("climb_speed", "m/s", 5.0, "FW_T_CLMB_MAX", 0.1),
    _parameter("descent_speed", "m/s", 5.0, "FW_T_SINK_MAX", 0.1),
    _parameter("landing_angle", "rad", radians(5), "FW_LND_ANG", 0.0, radians(85), radians(1)),
    _parameter("acceptance_radius", "m", 10.0, "NAV_ACC_RAD", 0.05),
    _parameter("loiter_radius", "m", 80.0, "NAV_LOITER_RAD"),
    *_SHARED,
)
"""A PX4 plane's parameters."""
