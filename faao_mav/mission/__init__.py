"""What an autopilot is given: items, home, fence and rally points, and the files that hold them."""

from faao_mav.mission.command import Command, Frame
from faao_mav.mission.item import Home, Mission, MissionItem

__all__ = ["Command", "Frame", "Home", "Mission", "MissionItem"]
