"""A vehicle: its type and the parameters that it is given."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from faao_mav.errors import InputError
from faao_mav.vehicle.flight_path import FlightModel, VerticalProfile
from faao_mav.vehicle.registry import vehicle_type
from faao_mav.vehicle.vehicle_type import LegLimits, VehicleType

if TYPE_CHECKING:
    from faao_mav.plan import Plan


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A vehicle, named as in a plan, with parameters by its autopilot's names and in its units.

    Parameters that are not given have the autopilot's defaults. `source` says where the parameters
    come from, for error messages. Methods raise `InputError` for a parameter that is no use, naming
    source, parameter and value; `usable` returns the vehicle without those.

    >>> vehicle = Vehicle("ardupilot", "copter", {"WPNAV_ACCEL": 400})
    >>> vehicle.value("acceleration"), vehicle.value("jerk")
    (4.0, 1.0)
    >>> vehicle.name_of("acceleration"), vehicle.name_of("jerk")
    ('WPNAV_ACCEL', 'WP_JERK, its default')
    """

    autopilot: str = "ardupilot"
    kind: str = "copter"
    parameters: Mapping[str, float] = field(default_factory=dict)
    source: str = "parameters"

    @property
    def type(self) -> VehicleType:
        """What is true of all vehicles of this autopilot and type."""
        return vehicle_type(self.autopilot, self.kind)

    def value(self, key: str) -> float:
        """Return the value of the parameter `key` in its table's unit: given, else the default."""
        parameter = self.type.parameters[key]
        name = parameter.name_in(self.parameters)
        value = parameter.default
        if name is not None:
            number = self.parameters[name]
            if not parameter.is_usable(number, name):
                raise InputError(
                    f"{self.source}: {name}: {number:g}; give {parameter.expected(name)}"
                )
            value = parameter.names[name] * number
        if parameter.capped_by:
            value = min(value, self.value(parameter.capped_by))
        return value

    def name_of(self, key: str) -> str:
        """Return the name by which `value(key)` is set, and that it is a default if it is."""
        parameter = self.type.parameters[key]
        name = parameter.name_in(self.parameters)
        if parameter.capped_by:
            cap = self.type.parameters[parameter.capped_by]
            own = (
                parameter.default if name is None else parameter.names[name] * self.parameters[name]
            )
            if self.value(cap.key) < own:
                return self.name_of(cap.key)
        return name if name is not None else f"{parameter.newest_name}, its default"

    def having(self, key: str, value: float) -> "Vehicle":
        """Return the vehicle with another `value` of the parameter `key`, at least its least."""
        parameter = self.type.parameters[key]
        name = parameter.newest_name
        number = max(value, parameter.least) / parameter.names[name]
        return replace(self, parameters={**self.parameters, name: number})

    def usable(self) -> "Vehicle":
        """Return the vehicle without the parameters that are no use: those have their defaults."""
        useless = {
            name
            for parameter in self.type.parameters.values()
            for name in parameter.names
            if name in self.parameters and not parameter.is_usable(self.parameters[name], name)
        }
        kept = {name: x for name, x in self.parameters.items() if name not in useless}
        return replace(self, parameters=kept) if useless else self

    @property
    def legs(self) -> LegLimits:
        """How it flies a leg between two waypoints."""
        if self.type.legs is None:
            raise InputError(f"missions are not made for {self.type.name}")
        return self.type.legs(self)

    @property
    def vertical(self) -> VerticalProfile:
        """How it takes off, climbs, returns and lands."""
        return self.type.vertical(self)

    def flight_model(self, latitude: float | None = None) -> FlightModel:
        """Return how it flies a mission at `latitude`, degrees.

        Raises `InputError` if there is no model of its type.
        """
        if self.type.flight_model is None:
            raise InputError(self.type.unmodelled)
        return self.type.flight_model(self, latitude)


def vehicle_of(plan: "Plan") -> Vehicle:
    """Return the vehicle of `plan`."""
    given = plan.vehicle
    return Vehicle(
        given.autopilot, given.type, given.parameters, f"{plan.source}: vehicle.parameters"
    )
