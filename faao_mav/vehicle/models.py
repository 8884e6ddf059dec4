"""Questions about a vehicle's flight model by other names, until their callers ask `Vehicle`."""

from typing import cast

from faao_mav.vehicle.flight_path import CopterModel, FlightModel
from faao_mav.vehicle.vehicle import Vehicle


def modelled(vehicle: Vehicle) -> bool:
    """Tell whether the flight of `vehicle` can be predicted."""
    return vehicle.type.flight_model is not None


def caveat(vehicle: Vehicle) -> str:
    """Return what to say of predictions for a `modelled` vehicle; nothing where they are proven."""
    return vehicle.type.caveat


def copter_model(vehicle: Vehicle, latitude: float | None = None) -> CopterModel:
    """Return the model of a multicopter that flies at `latitude`, degrees."""
    return cast(CopterModel, vehicle.flight_model(latitude))


def flight_model(vehicle: Vehicle, latitude: float | None = None) -> FlightModel:
    """Return the model of `vehicle` with its parameters."""
    return vehicle.flight_model(latitude)
