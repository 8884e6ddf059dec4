"""How ArduCopter flies a mission."""

from faao_mav.vehicle.ardupilot.copter.model import ArduCopter

__all__ = ["ArduCopter"]
