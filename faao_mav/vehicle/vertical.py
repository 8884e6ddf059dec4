"""Climbs and descents outside waypoint flight: take-off, return, landing."""

from dataclasses import dataclass

from faao_mav.mission.vehicle import Vehicle
from faao_mav.vehicle.limits import Parameter, limits_of

_ARDUPILOT = {
    "climb_speed": Parameter({"WP_SPD_UP": 1.0, "WPNAV_SPEED_UP": 0.01}, 0.1),
    "descent_speed": Parameter({"WP_SPD_DN": 1.0, "WPNAV_SPEED_DN": 0.01}, 0.1),
    "acceleration": Parameter({"WP_ACC_Z": 1.0, "WPNAV_ACCEL_Z": 0.01}, 0.1),
    "landing_speed": Parameter({"LAND_SPD_MS": 1.0, "LAND_SPEED": 0.01}, 0.05),
    "return_height": Parameter({"RTL_ALT_M": 1.0, "RTL_ALT": 0.01}, 0.0),
}
_PX4 = {
    "climb_speed": Parameter({"MPC_TKO_SPEED": 1.0}, 0.1),
    "descent_speed": Parameter({"MPC_Z_V_AUTO_DN": 1.0, "MPC_Z_VEL_MAX_DN": 1.0}, 0.1),
    "acceleration": Parameter({"MPC_ACC_UP_MAX": 1.0}, 0.1),
    "landing_speed": Parameter({"MPC_LAND_SPEED": 1.0}, 0.05),
    "return_height": Parameter({"RTL_RETURN_ALT": 1.0}, 0.0),
}


@dataclass(frozen=True, slots=True)
class Vertical:
    """How fast a vehicle climbs and descends, m/s, m/s², and how high it returns, m above home.

    `spool` is what a take-off takes before it climbs, s; the last `landing_height` metres are
    flown at `landing_speed`. Defaults are ArduCopter's: 100 m of take-off take 46 s.
    """

    climb_speed: float = 2.5
    descent_speed: float = 1.5
    acceleration: float = 1.0
    landing_speed: float = 0.5
    landing_height: float = 10.0
    return_height: float = 15.0
    spool: float = 3.5

    @classmethod
    def of(cls, vehicle: Vehicle) -> "Vertical":
        """Return the limits of `vehicle`. Raises `InputError` for useless parameters."""
        if vehicle.autopilot == "px4":
            own = cls(1.5, 1.5, 4.0, 0.7, 10.0, 60.0, 2.0)
            names = _PX4
        else:
            own, names = cls(), _ARDUPILOT
        limits = {name: getattr(own, name) for name in cls.__slots__}
        return cls(**(limits | limits_of(vehicle, names)))

    def take_off(self, height: float) -> float:
        """Return how long a take-off to `height` (m) takes, s."""
        return self.spool + self.climb(height)

    def climb(self, height: float) -> float:
        """Return how long a climb of `height` (m) takes, s."""
        return self._ramped(height, self.climb_speed)

    def descend(self, height: float) -> float:
        """Return how long the way down to the ground takes, s."""
        slow = min(max(height, 0.0), self.landing_height)
        return slow / self.landing_speed + self._ramped(height - slow, self.descent_speed)

    def _ramped(self, height: float, speed: float) -> float:
        return height / speed + speed / self.acceleration if height > 0 else 0.0
