"""Flight modes, as far as they start a mission."""

from faao_mav.mavlink.messages import CommandLong
from faao_mav.mavlink.mock.behaviour import Behaviour, packed_mode

_CUSTOM_MODE = 1
"""MAV_MODE_FLAG_CUSTOM_MODE_ENABLED."""

_AUTO_FLAGS = 4 | 8 | 16
"""MAV_MODE_FLAG bits: auto, guided, stabilised."""


class Modes:
    """The custom mode of a vehicle, in its firmware's own numbers."""

    def __init__(self, behaviour: Behaviour, kind: str) -> None:
        self.custom_mode, self._mission_mode = behaviour.modes[kind]
        self._packed = behaviour.packed_modes

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
        if self._packed:
            return packed_mode(whole(command.param2), whole(command.param3))
        return max(whole(command.param2), 0)


def whole(param: float) -> int:
    """Return a command's parameter as a number of something, -1 if it cannot be one."""
    return int(param) if 0 <= param < 2**32 else -1
