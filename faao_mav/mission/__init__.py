"""What an autopilot is given: missions, and how a trajectory becomes one."""

from faao_mav.mission.assemble import assemble
from faao_mav.mission.command import Command, Frame
from faao_mav.mission.convert import Conversion, convert, to_mission
from faao_mav.mission.item import Home, Mission, MissionItem
from faao_mav.mission.outline import plan_route
from faao_mav.mission.route import Route

__all__ = [
    "Command",
    "Conversion",
    "Frame",
    "Home",
    "Mission",
    "MissionItem",
    "Route",
    "assemble",
    "convert",
    "plan_route",
    "to_mission",
]
