"""What an autopilot is given: items, home, fence and rally points, and the files that hold them."""

from faao_mav.mission.command import Command as Command
from faao_mav.mission.command import Frame as Frame
from faao_mav.mission.item import Home as Home
from faao_mav.mission.item import Mission as Mission
from faao_mav.mission.item import MissionItem as MissionItem
