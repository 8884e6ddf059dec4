"""PX4's parameters, of its multicopters and of its planes.

Source: PX4 1.16, parameter reference.
"""

from dataclasses import dataclass
from math import inf

from faao_mav.autopilot.body import PX4_BODY, CopterBody
from faao_mav.autopilot.model import Model, parameter
from faao_mav.autopilot.parameter import row, rule, table

_SHARED = (
    rule("takeoff_land_required", 0, "MIS_TKO_LAND_REQ"),
    rule("first_waypoint_distance", 10_000.0, "MIS_DIST_1WP", "m"),
    rule("takeoff_height", 2.5, "MIS_TAKEOFF_ALT", "m"),
    rule("fence_action", 2, "GF_ACTION"),
    rule("fence_predict", 0, "GF_PREDICT"),
    rule("fence_distance", 0.0, "GF_MAX_HOR_DIST", "m"),
    rule("fence_height", 0.0, "GF_MAX_VER_DIST", "m"),
    rule("return_height", 60.0, "RTL_RETURN_ALT", "m", 0.0),
    rule("return_type", 0, "RTL_TYPE"),
)
"""Mission checks, fence and return."""


@dataclass(frozen=True, slots=True)
class Px4Limits(Model):
    """What bounds a multicopter's flight, in SI units; `body` is the aircraft.

    In missions it climbs at MPC_Z_V_AUTO_UP, which PX4 lowers to MPC_Z_VEL_MAX_UP (mc_pos_control,
    parameters_update); likewise down, and over the ground.
    """

    cruise_speed: float = parameter("m/s", 5.0, "MPC_XY_CRUISE", capped_by="max_speed")
    max_speed: float = parameter("m/s", 12.0, "MPC_XY_VEL_MAX")
    acceleration: float = parameter("m/s^2", 3.0, "MPC_ACC_HOR")
    jerk: float = parameter("m/s^3", 4.0, "MPC_JERK_AUTO")
    corner_gain: float = parameter("1/s", 0.5, "MPC_XY_TRAJ_P", least=0.01)
    error_limit: float = parameter("m", 2.0, "MPC_XY_ERR_MAX")
    acceptance_radius: float = parameter("m", 2.0, "NAV_ACC_RAD", least=0.05)
    height_radius: float = parameter("m", 0.8, "NAV_MC_ALT_RAD", least=0.05)
    climb_speed: float = parameter("m/s", 3.0, "MPC_Z_V_AUTO_UP", capped_by="max_climb_speed")
    descent_speed: float = parameter("m/s", 1.5, "MPC_Z_V_AUTO_DN", capped_by="max_descent_speed")
    climb_acceleration: float = parameter("m/s^2", 4.0, "MPC_ACC_UP_MAX")
    descent_acceleration: float = parameter("m/s^2", 3.0, "MPC_ACC_DOWN_MAX")
    body: CopterBody = PX4_BODY

    def vertical(self, rise: float) -> tuple[float, float]:
        """Return the greatest speed, m/s, and acceleration, m/s², of a climb by `rise`, m."""
        if rise > 0:
            return self.climb_speed, self.climb_acceleration
        return self.descent_speed, self.descent_acceleration


COPTER_TABLE = table(
    *Px4Limits.parameters(),
    row("greatest_acceleration", "m/s^2", 5.0, "MPC_ACC_HOR_MAX", least=0.1),
    row("lean_angle", "rad", 45, "MPC_TILTMAX_AIR", least=20, greatest=89),
    row("max_climb_speed", "m/s", 3.0, "MPC_Z_VEL_MAX_UP"),
    row("max_descent_speed", "m/s", 1.5, "MPC_Z_VEL_MAX_DN"),
    row("take_off_speed", "m/s", 1.5, "MPC_TKO_SPEED"),
    row("landing_speed", "m/s", 0.7, "MPC_LAND_SPEED", least=0.05),
    *_SHARED,
)
"""A PX4 multicopter's parameters."""

PLANE_TABLE = table(
    row("cruise_speed", "m/s", 15.0, "FW_AIRSPD_TRIM", least=1.0),
    row("min_speed", "m/s", 10.0, "FW_AIRSPD_MIN", least=1.0),
    row("max_speed", "m/s", 20.0, "FW_AIRSPD_MAX", least=1.0),
    row("roll_limit", "rad", 50, "FW_R_LIM", least=5, greatest=85),
    row("climb_speed", "m/s", 5.0, "FW_T_CLMB_MAX"),
    row("descent_speed", "m/s", 5.0, "FW_T_SINK_MAX"),
    row("landing_angle", "rad", 5, "FW_LND_ANG", least=0, greatest=85),
    row("acceptance_radius", "m", 10.0, "NAV_ACC_RAD", least=0.05),
    row("loiter_radius", "m", 80.0, "NAV_LOITER_RAD", least=-inf),
    *_SHARED,
)
"""A PX4 plane's parameters."""
