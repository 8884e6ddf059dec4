"""What is read back of a row, by another name, until its callers ask `Vehicle.type`."""

from faao_mav.vehicle.dialects import as_stored

__all__ = ["as_stored"]
