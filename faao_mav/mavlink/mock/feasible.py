"""What PX4 holds against a mission after it has acknowledged it."""

from faao_mav.mission.command import Command
from faao_mav.mission.item import Mission

_CONDITION_DELAY = 112
_POSITIONS = frozenset({16, 17, 18, 19, 21, 22, 31, 82, 84, 85})


def infeasible(mission: Mission) -> str | None:
    """Return why PX4 would not fly `mission` though it took it, or None.

    It says so in an event only, and refuses to start.
    """
    commands = [item.command for item in mission.items]
    positions = [command for command in commands if command in _POSITIONS]
    takeoffs = [item for item in mission.items if item.command == Command.NAV_TAKEOFF]
    if _CONDITION_DELAY in commands:
        return "unsupported command"
    if any(item.z <= 0 for item in takeoffs):
        return "take-off altitude too low"
    if len(takeoffs) > 1 or (takeoffs and positions[0] != Command.NAV_TAKEOFF):
        return "take-off is not the first position"
    if positions[:1] == [Command.NAV_LAND]:
        return "starts with landing"
    return None
