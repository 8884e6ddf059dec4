"""From a trajectory to a timed mission whose predicted flight keeps it."""

from faao_mav.schedule.assemble import assemble
from faao_mav.schedule.convert import Conversion, convert, to_mission
from faao_mav.schedule.outline import plan_route
from faao_mav.schedule.route import Route

__all__ = ["Conversion", "Route", "assemble", "convert", "plan_route", "to_mission"]
