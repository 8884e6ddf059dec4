"""The parameters that ground stations ask a mock autopilot for, and its answers."""

from collections.abc import Mapping

from faao_mav.mavlink.messages import (
    Message,
    ParamRequestList,
    ParamRequestRead,
    ParamSet,
    ParamValue,
)
from faao_mav.mission.vehicle import Vehicle

_REAL32 = 9

_DEFAULTS: dict[str, dict[str, float]] = {
    "ardupilot": {
        "SYSID_THISMAV": 1,
        "FRAME_CLASS": 1,
        "FENCE_ENABLE": 0,
        "WPNAV_SPEED": 1000,
        "WPNAV_SPEED_UP": 250,
        "WPNAV_SPEED_DN": 150,
        "WPNAV_ACCEL": 250,
        "WPNAV_JERK": 1,
        "WPNAV_RADIUS": 200,
        "ANGLE_MAX": 3000,
    },
    "px4": {
        "MIS_TAKEOFF_ALT": 2.5,
        "MPC_ACC_HOR": 3,
        "MPC_JERK_AUTO": 4,
        "MPC_XY_CRUISE": 5,
        "MPC_XY_VEL_MAX": 12,
        "NAV_ACC_RAD": 2,
        "NAV_MC_ALT_RAD": 0.8,
    },
}


class Parameters:
    """A few parameters by name, and those that were given; all are single-precision numbers."""

    def __init__(self, vehicle: Vehicle, given: Mapping[str, float] | None = None) -> None:
        self.values = _DEFAULTS[vehicle.autopilot] | dict(given or {})

    def on(self, message: ParamRequestList | ParamRequestRead | ParamSet) -> list[Message]:
        """Return the answer to a request; unknown names get none."""
        match message:
            case ParamRequestList():
                return [self._value(name) for name in self.values]
            case ParamRequestRead(param_index=-1, param_id=name):
                return [self._value(name)] if name in self.values else []
            case ParamRequestRead(param_index=index):
                names = list(self.values)
                return [self._value(names[index])] if 0 <= index < len(names) else []
            case ParamSet(param_id=name, param_value=value):
                if name in self.values:
                    self.values[name] = value
                    return [self._value(name)]
        return []

    def _value(self, name: str) -> ParamValue:
        index = list(self.values).index(name)
        return ParamValue(name, float(self.values[name]), _REAL32, len(self.values), index)
