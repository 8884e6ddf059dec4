"""The autopilots' parameters that rules use: names, units, defaults.

Defaults as of ArduPilot 4.7 and PX4 1.16; newer names first, because a parameter file may carry
both generations.
"""

import math
from dataclasses import dataclass

from faao_mav.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter's names, each with the factor that makes it SI (angles: degrees), its default."""

    default: float
    names: tuple[tuple[str, float], ...]

    def of(self, vehicle: Vehicle) -> float:
        """Return the value that `vehicle` has, or the default; a value that is no number: that."""
        for name, factor in self.names:
            value = vehicle.parameters.get(name, math.nan)
            if math.isfinite(value):
                return value * factor
        return self.default

    def name(self, vehicle: Vehicle) -> str:
        """Return the name by which `vehicle` has it, or the first name and that it is a default."""
        for name, _ in self.names:
            if math.isfinite(vehicle.parameters.get(name, math.nan)):
                return name
        return f"{self.names[0][0]}, its default"


def _si(default: float, *names: str) -> Parameter:
    return Parameter(default, tuple((name, 1.0) for name in names))


def _renamed(default: float, new: str, old: str, factor: float) -> Parameter:
    return Parameter(default, ((new, 1.0), (old, factor)))


# ArduCopter
COPTER_SPEED = _renamed(10.0, "WP_SPD", "WPNAV_SPEED", 0.01)
COPTER_CLIMB = _renamed(2.5, "WP_SPD_UP", "WPNAV_SPEED_UP", 0.01)
COPTER_DESCENT = _renamed(1.5, "WP_SPD_DN", "WPNAV_SPEED_DN", 0.01)
COPTER_ACCELERATION = _renamed(2.5, "WP_ACC", "WPNAV_ACCEL", 0.01)
COPTER_JERK = _si(1.0, "WP_JERK", "WPNAV_JERK")
COPTER_LEAN = _renamed(30.0, "ATC_ANGLE_MAX", "ANGLE_MAX", 0.01)
COPTER_RTL_ALTITUDE = _renamed(15.0, "RTL_ALT_M", "RTL_ALT", 0.01)

# ArduPlane
PLANE_SPEED = _renamed(12.0, "AIRSPEED_CRUISE", "TRIM_ARSPD_CM", 0.01)
PLANE_LEAST_SPEED = _si(9.0, "AIRSPEED_MIN", "ARSPD_FBW_MIN")
PLANE_TOP_SPEED = _si(22.0, "AIRSPEED_MAX", "ARSPD_FBW_MAX")
PLANE_BANK = _renamed(45.0, "ROLL_LIMIT_DEG", "LIM_ROLL_CD", 0.01)
PLANE_CLIMB = _si(5.0, "TECS_CLMB_MAX")
PLANE_RTL_ALTITUDE = _renamed(100.0, "RTL_ALTITUDE", "ALT_HOLD_RTL", 0.01)

# ArduPilot
ARMING_ITEMS = _si(0.0, "ARMING_MIS_ITEMS")
FENCE_ENABLE = _si(0.0, "FENCE_ENABLE")
FENCE_OPTIONS = _si(0.0, "FENCE_OPTIONS")
FENCE_CEILING = _si(100.0, "FENCE_ALT_MAX")
FENCE_FLOOR = _si(-10.0, "FENCE_ALT_MIN")
FENCE_RADIUS = _si(300.0, "FENCE_RADIUS")
SD_STORAGE = _si(0.0, "BRD_SD_MISSION")
TERRAIN_ENABLE = _si(1.0, "TERRAIN_ENABLE")

# PX4
PX4_SPEED = _si(5.0, "MPC_XY_CRUISE")
PX4_TOP_SPEED = _si(12.0, "MPC_XY_VEL_MAX")
PX4_ACCELERATION = _si(3.0, "MPC_ACC_HOR")
PX4_JERK = _si(4.0, "MPC_JERK_AUTO")
PX4_CLIMB = _si(3.0, "MPC_Z_V_AUTO_UP")
PX4_DESCENT = _si(1.5, "MPC_Z_V_AUTO_DN")
PX4_TAKEOFF_LAND = _si(0.0, "MIS_TKO_LAND_REQ")
PX4_FIRST_DISTANCE = _si(10_000.0, "MIS_DIST_1WP")
PX4_TAKEOFF_ALTITUDE = _si(2.5, "MIS_TAKEOFF_ALT")
PX4_MAX_HORIZONTAL = _si(0.0, "GF_MAX_HOR_DIST")
PX4_MAX_VERTICAL = _si(0.0, "GF_MAX_VER_DIST")
PX4_LANDING_ANGLE = _si(5.0, "FW_LND_ANG")
PX4_PLANE_SPEED = _si(15.0, "FW_AIRSPD_TRIM")
PX4_PLANE_LEAST_SPEED = _si(10.0, "FW_AIRSPD_MIN")
PX4_PLANE_TOP_SPEED = _si(20.0, "FW_AIRSPD_MAX")
PX4_PLANE_BANK = _si(50.0, "FW_R_LIM")
PX4_PLANE_CLIMB = _si(8.0, "FW_T_CLMB_MAX")
PX4_RTL_ALTITUDE = _si(60.0, "RTL_RETURN_ALT")

_RADIUS_COPTER = _si(2.0, "NAV_ACC_RAD")
_RADIUS_PLANE = _si(10.0, "NAV_ACC_RAD")
_FENCE_TYPE_COPTER = _si(7.0, "FENCE_TYPE")
_FENCE_TYPE_PLANE = _si(4.0, "FENCE_TYPE")
_RALLY_COPTER = Parameter(300.0, (("RALLY_LIMIT_KM", 1000.0),))
_RALLY_PLANE = Parameter(5000.0, (("RALLY_LIMIT_KM", 1000.0),))


def acceptance_radius(vehicle: Vehicle) -> Parameter:
    """Return PX4's acceptance radius, which the airframe sets."""
    return _RADIUS_COPTER if vehicle.kind == "copter" else _RADIUS_PLANE


def fence_type(vehicle: Vehicle) -> Parameter:
    """Return the fences that ArduPilot keeps: bits 1 ceiling, 2 circle, 4 areas, 8 floor."""
    return _FENCE_TYPE_COPTER if vehicle.kind == "copter" else _FENCE_TYPE_PLANE


def rally_limit(vehicle: Vehicle) -> Parameter:
    """Return how far ArduPilot looks for a rally point, m; 0: any distance."""
    return _RALLY_COPTER if vehicle.kind == "copter" else _RALLY_PLANE


def cruise_speed(vehicle: Vehicle) -> Parameter:
    """Return the speed of legs before any DO_CHANGE_SPEED, m/s."""
    if vehicle.autopilot == "px4":
        return PX4_SPEED if vehicle.kind == "copter" else PX4_PLANE_SPEED
    return COPTER_SPEED if vehicle.kind == "copter" else PLANE_SPEED


def climb_speed(vehicle: Vehicle) -> Parameter:
    """Return the greatest speed upwards, m/s."""
    if vehicle.autopilot == "px4":
        return PX4_CLIMB if vehicle.kind == "copter" else PX4_PLANE_CLIMB
    return COPTER_CLIMB if vehicle.kind == "copter" else PLANE_CLIMB


def return_altitude(vehicle: Vehicle) -> Parameter:
    """Return the height at which the vehicle returns, m above home."""
    if vehicle.autopilot == "px4":
        return PX4_RTL_ALTITUDE
    return COPTER_RTL_ALTITUDE if vehicle.kind == "copter" else PLANE_RTL_ALTITUDE
