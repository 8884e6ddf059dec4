"""What every vehicle is, and how it will fly a mission.

The four vehicles that are known are registered here; `register` adds another.
"""

from faao_mav.vehicle.ardupilot.copter import ARDUCOPTER
from faao_mav.vehicle.ardupilot.plane import ARDUPLANE
from faao_mav.vehicle.flight_path import FlightModel, FlightPath, Flown, Track
from faao_mav.vehicle.px4 import PX4_COPTER, PX4_PLANE
from faao_mav.vehicle.registry import (
    families,
    family,
    kind_by_number,
    register,
    unregister,
    vehicle_type,
    vehicle_type_by_numbers,
    vehicle_types,
)
from faao_mav.vehicle.vehicle import Vehicle, vehicle_of
from faao_mav.vehicle.vehicle_type import AutopilotFamily, Ceiling, LegLimits, VehicleType

__all__ = [
    "ARDUCOPTER",
    "ARDUPLANE",
    "PX4_COPTER",
    "PX4_PLANE",
    "AutopilotFamily",
    "Ceiling",
    "FlightModel",
    "FlightPath",
    "Flown",
    "LegLimits",
    "Track",
    "Vehicle",
    "VehicleType",
    "families",
    "family",
    "kind_by_number",
    "register",
    "unregister",
    "vehicle_of",
    "vehicle_type",
    "vehicle_type_by_numbers",
    "vehicle_types",
]

for _vehicle_type in (ARDUCOPTER, ARDUPLANE, PX4_COPTER, PX4_PLANE):
    register(_vehicle_type)
