"""From a trajectory to a timed mission whose predicted flight keeps it."""

from faao_mav.schedule.conversion import Conversion as Conversion
from faao_mav.schedule.conversion import convert as convert
