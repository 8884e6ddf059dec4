"""From a trajectory to a timed mission whose predicted flight keeps it."""

from faao_mav.schedule.conversion import Conversion, convert
from faao_mav.schedule.route import Route

__all__ = ["Conversion", "Route", "convert"]
