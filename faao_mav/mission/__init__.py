"""What an autopilot is given: missions, and how a trajectory becomes one."""

from faao_mav.mission.assemble import assemble
from faao_mav.mission.command import Command, Frame
from faao_mav.mission.convert import plan_route, to_mission
from faao_mav.mission.item import Home, Mission, MissionItem
from faao_mav.mission.route import Route

__all__ = [
    "Command",
    "Frame",
    "Home",
    "Mission",
    "MissionItem",
    "Route",
    "assemble",
    "plan_route",
    "to_mission",
]
