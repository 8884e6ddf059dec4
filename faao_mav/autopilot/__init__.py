"""What every vehicle is, and how it will fly a mission.

The four vehicles that are known are registered here; `register` adds another.
"""

from faao_mav.autopilot.ardupilot.copter import ARDUCOPTER as ARDUCOPTER
from faao_mav.autopilot.ardupilot.plane import ARDUPLANE as ARDUPLANE
from faao_mav.autopilot.model import FlightPath as FlightPath
from faao_mav.autopilot.model import Flown as Flown
from faao_mav.autopilot.model import Model as Model
from faao_mav.autopilot.model import Track as Track
from faao_mav.autopilot.px4 import PX4_COPTER as PX4_COPTER
from faao_mav.autopilot.px4 import PX4_PLANE as PX4_PLANE
from faao_mav.autopilot.vehicle import Vehicle as Vehicle
from faao_mav.autopilot.vehicle import autopilots as autopilots
from faao_mav.autopilot.vehicle import families as families
from faao_mav.autopilot.vehicle import kind_by_number as kind_by_number
from faao_mav.autopilot.vehicle import kinds as kinds
from faao_mav.autopilot.vehicle import register as register
from faao_mav.autopilot.vehicle import unregister as unregister
from faao_mav.autopilot.vehicle import vehicle_type as vehicle_type
from faao_mav.autopilot.vehicle import vehicle_type_by_numbers as vehicle_type_by_numbers
from faao_mav.autopilot.vehicle import vehicle_types as vehicle_types
from faao_mav.autopilot.vehicle_type import AutopilotFamily as AutopilotFamily
from faao_mav.autopilot.vehicle_type import VehicleType as VehicleType

for _vehicle_type in (ARDUCOPTER, ARDUPLANE, PX4_COPTER, PX4_PLANE):
    register(_vehicle_type)
