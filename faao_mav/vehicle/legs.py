"""How vehicles fly legs, by another name, until its callers ask `Vehicle.legs`."""

from faao_mav.vehicle.ardupilot.copter.legs import ArduCopterLegs
from faao_mav.vehicle.px4.legs import Px4Legs
from faao_mav.vehicle.vehicle import Vehicle
from faao_mav.vehicle.vehicle_type import LegLimits as Legs

__all__ = ["ArduCopterLegs", "Legs", "Px4Legs", "legs_of"]


def legs_of(vehicle: Vehicle) -> Legs:
    """Return how `vehicle` flies legs, by its autopilot and its parameters."""
    return vehicle.legs
