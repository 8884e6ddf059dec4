"""How a vehicle will fly a mission."""

from faao_mav.vehicle.flight_path import CopterModel, FlightModel, FlightPath, Flown
from faao_mav.vehicle.models import caveat, copter_model, flight_model, modelled
from faao_mav.vehicle.track import Track

__all__ = [
    "CopterModel",
    "FlightModel",
    "FlightPath",
    "Flown",
    "Track",
    "caveat",
    "copter_model",
    "flight_model",
    "modelled",
]
