"""How a vehicle will fly a mission."""

from faao_mav.mission.flight.models import caveat, copter_model, flight_model, modelled
from faao_mav.mission.flight.path import CopterModel, FlightModel, FlightPath, Flown
from faao_mav.mission.flight.track import Track

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
