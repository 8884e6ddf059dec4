"""Which model predicts the flight of a vehicle."""

from faao_mav.errors import InputError
from faao_mav.mission.vehicle import Vehicle
from faao_mav.vehicle.ardupilot.copter import ArduCopter
from faao_mav.vehicle.flight_path import CopterModel, FlightModel


def modelled(vehicle: Vehicle) -> bool:
    """Tell whether the flight of `vehicle` can be predicted."""
    return vehicle.kind == "copter" or vehicle.autopilot == "ardupilot"


def caveat(vehicle: Vehicle) -> str:
    """Return what to say of predictions for a `modelled` vehicle; nothing where they are proven."""
    if flight_model(vehicle).calibrated:
        return ""
    return "by a model after the autopilot's documents, not compared with recorded flights"


def copter_model(vehicle: Vehicle, latitude: float | None = None) -> CopterModel:
    """Return the model of a multicopter that flies at `latitude`, degrees.

    Raises `InputError` for useless parameters.
    """
    if vehicle.autopilot == "px4":
        from faao_mav.vehicle.px4 import Px4

        return Px4.from_vehicle(vehicle)
    return ArduCopter.from_vehicle(vehicle, latitude)


def flight_model(vehicle: Vehicle, latitude: float | None = None) -> FlightModel:
    """Return the model of `vehicle` with its parameters.

    Raises `InputError` for useless ones, and for a vehicle that is not `modelled`.
    """
    if not modelled(vehicle):
        raise InputError("there is no model of how PX4 flies planes")
    if vehicle.kind == "plane":
        from faao_mav.vehicle.ardupilot.plane.model import ArduPlane

        return ArduPlane.from_vehicle(vehicle)
    return copter_model(vehicle, latitude)
