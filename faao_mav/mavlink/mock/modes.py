"""Flight modes, as far as they start a mission."""

from faao_mav.mavlink.messages import CommandLong
from faao_mav.mission.vehicle import Vehicle


def _packed(main: int, sub: int) -> int:
    """Return PX4's custom mode for a main and a sub mode; 0 for numbers that are none."""
    if not (0 <= main < 256 and 0 <= sub < 256):
        return 0
    return main << 16 | sub << 24


_PX4 = (_packed(4, 3), _packed(4, 4))
_MODES = {
    ("ardupilot", "copter"): (0, 3),
    ("ardupilot", "plane"): (2, 10),
    ("px4", "copter"): _PX4,
    ("px4", "plane"): _PX4,
}
"""Custom modes at rest and on a mission.

ArduPilot's are STABILIZE and AUTO of COPTER_MODE and PLANE_MODE in MAVLink's ardupilotmega dialect,
PX4's are AUTO LOITER and AUTO MISSION of its `px4_custom_mode.h`.
"""

_CUSTOM_MODE = 1
"""MAV_MODE_FLAG_CUSTOM_MODE_ENABLED."""

_AUTO_FLAGS = 4 | 8 | 16
"""MAV_MODE_FLAG bits: auto, guided, stabilised."""


class Modes:
    """The custom mode of a vehicle, in its firmware's own numbers."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.custom_mode, self._mission_mode = _MODES[vehicle.autopilot, vehicle.kind]
        self._packs = vehicle.autopilot == "px4"

    @property
    def is_mission(self) -> bool:
        """Whether the mode is to fly the mission."""
        return self.would_be_mission(self.custom_mode)

    @property
    def base_mode(self) -> int:
        """MAV_MODE_FLAG bits without the armed one."""
        return _CUSTOM_MODE | (_AUTO_FLAGS if self.is_mission else 0)

    def would_be_mission(self, mode: int) -> bool:
        """Tell whether custom mode `mode` is to fly the mission."""
        return mode == self._mission_mode

    def set_mission(self) -> None:
        """Change to the mission."""
        self.custom_mode = self._mission_mode

    def of_command(self, command: CommandLong) -> int:
        """Return the custom mode that DO_SET_MODE asks for."""
        if self._packs:
            return _packed(whole(command.param2), whole(command.param3))
        return max(whole(command.param2), 0)


def whole(param: float) -> int:
    """Return a command's parameter as a number of something, -1 if it cannot be one."""
    return int(param) if 0 <= param < 2**32 else -1
