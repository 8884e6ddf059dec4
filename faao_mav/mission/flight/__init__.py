"""How a vehicle will fly a mission."""

from faao_mav.mission.flight.models import flight_model
from faao_mav.mission.flight.path import FlightModel, FlightPath, Flown
from faao_mav.mission.flight.track import Track

__all__ = ["FlightModel", "FlightPath", "Flown", "Track", "flight_model"]
