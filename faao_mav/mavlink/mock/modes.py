"""Flight modes, as far as they start a mission."""

from faao_mav.mavlink.messages import CommandLong
from faao_mav.plan.autopilots import Autopilot, Kind

_STABILIZE: dict[Kind, int] = {"copter": 0, "plane": 2}
_AUTO: dict[Kind, int] = {"copter": 3, "plane": 10}
_PX4_AUTO, _PX4_MISSION, _PX4_LOITER = 4, 4, 3
_CUSTOM_MODE = 1  # MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
_AUTO_FLAGS = 4 | 8 | 16  # auto, guided, stabilised


class Modes:
    """The custom mode of a vehicle, in its firmware's own numbers.

    ArduPilot's are those of COPTER_MODE and PLANE_MODE in MAVLink's ardupilotmega dialect.
    """

    def __init__(self, autopilot: Autopilot, kind: Kind = "copter") -> None:
        self.autopilot, self._kind = autopilot, kind
        self.custom_mode = (
            _STABILIZE[kind] if autopilot == "ardupilot" else _px4_mode(_PX4_AUTO, _PX4_LOITER)
        )

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
        return mode == self._mission_mode()

    def set_mission(self) -> None:
        """Change to the mission."""
        self.custom_mode = self._mission_mode()

    def of_command(self, command: CommandLong) -> int:
        """Return the custom mode that DO_SET_MODE asks for."""
        if self.autopilot == "ardupilot":
            return max(whole(command.param2), 0)
        return _px4_mode(whole(command.param2), whole(command.param3))

    def _mission_mode(self) -> int:
        if self.autopilot == "ardupilot":
            return _AUTO[self._kind]
        return _px4_mode(_PX4_AUTO, _PX4_MISSION)


def whole(param: float) -> int:
    """Return a command's parameter as a number of something, -1 if it cannot be one."""
    return int(param) if 0 <= param < 2**32 else -1


def _px4_mode(main: int, sub: int) -> int:
    if not (0 <= main < 256 and 0 <= sub < 256):
        return 0
    return main << 16 | sub << 24
