"""The vehicles that are known, by the names of autopilot and type.

Another vehicle is one folder with one `VehicleType` and one call of `register`.
"""

from dataclasses import dataclass

from faao_mav.errors import InputError
from faao_mav.plan.autopilots import VEHICLES, PlannedVehicle
from faao_mav.vehicle.parameter import ParameterTable
from faao_mav.vehicle.vehicle_type import AutopilotFamily, VehicleType

_TYPES: dict[tuple[str, str], VehicleType] = {}


@dataclass(frozen=True, slots=True)
class _Defaults:
    """The default of every parameter of `table`."""

    table: ParameterTable

    def value(self, key: str) -> float:
        return self.table[key].default


def register(vehicle_type: VehicleType) -> VehicleType:
    """Make `vehicle_type` known by its names, to plans as well, and return it."""
    key = (vehicle_type.family.key, vehicle_type.kind)
    _TYPES[key] = vehicle_type
    planned = vehicle_type.legs is not None and vehicle_type.flight_model is not None
    own = _Defaults(vehicle_type.parameters)
    one, holds = vehicle_type.fence_needs_one_inclusion(own), vehicle_type.max_airspeed(own)
    VEHICLES[key] = PlannedVehicle(*key, vehicle_type.hovers, planned, one, holds)
    return vehicle_type


def unregister(vehicle_type: VehicleType) -> None:
    """Forget `vehicle_type`."""
    key = (vehicle_type.family.key, vehicle_type.kind)
    del _TYPES[key], VEHICLES[key]


def vehicle_types() -> tuple[VehicleType, ...]:
    """Return every vehicle type that is known."""
    return tuple(_TYPES.values())


def vehicle_type(autopilot: str, kind: str) -> VehicleType:
    """Return the vehicle type with these names.

    Raises `InputError` that lists the known names if there is none.

    >>> vehicle_type("ardupilot", "copter").name
    'ArduCopter'
    """
    try:
        return _TYPES[autopilot, kind]
    except KeyError:
        known = ", ".join(" ".join(key) for key in _TYPES)
        raise InputError(f"vehicle: {autopilot} {kind} is unknown; known are {known}") from None


def families() -> tuple[AutopilotFamily, ...]:
    """Return every autopilot that is known."""
    return tuple({each.family.key: each.family for each in _TYPES.values()}.values())


def family(autopilot: str) -> AutopilotFamily:
    """Return the autopilot with this name; raises `InputError` if there is none."""
    for each in families():
        if each.key == autopilot:
            return each
    known = ", ".join(each.key for each in families())
    raise InputError(f"autopilot: {autopilot} is unknown; known are {known}")


def kind_by_number(mav_type: int | None) -> str | None:
    """Return the type of vehicle with this MAV_TYPE number, whatever its autopilot, or None."""
    return next((each.kind for each in _TYPES.values() if mav_type in each.mav_types), None)


def vehicle_type_by_numbers(mav_autopilot: int, mav_type: int | None) -> VehicleType | None:
    """Return the vehicle type with these MAV_AUTOPILOT and MAV_TYPE numbers.

    Without a MAV_TYPE it is the first type of that autopilot; None for numbers that are unknown.
    """
    own = (each for each in _TYPES.values() if each.family.mav_autopilot == mav_autopilot)
    return next((each for each in own if mav_type is None or mav_type in each.mav_types), None)
