"""How ArduCopter flies a mission."""

from faao_mav.mission.flight.arducopter.model import ArduCopter

__all__ = ["ArduCopter"]
