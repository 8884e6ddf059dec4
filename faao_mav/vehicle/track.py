"""`Track` by its former place, until its callers import it from `faao_mav.vehicle`."""

from faao_mav.vehicle.flight_path import Track

__all__ = ["Track"]
