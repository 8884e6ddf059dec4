"""Who flies the mission: autopilot, kind of aircraft, parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from faao_mav.plan import Plan

Autopilot: TypeAlias = Literal["ardupilot", "px4"]
Kind: TypeAlias = Literal["copter", "plane"]

AUTOPILOT_NAMES = {"ardupilot": "ArduPilot", "px4": "PX4"}


@dataclass(frozen=True, slots=True)
class Vehicle:
    """An aircraft as far as missions are concerned.

    `parameters` are the autopilot's, by its own names and in its own units; those that are not
    given have the autopilot's defaults. `source` says where they come from, for error messages.
    """

    autopilot: Autopilot = "ardupilot"
    kind: Kind = "copter"
    parameters: Mapping[str, float] = field(default_factory=dict)
    source: str = "parameters"


def vehicle_of(plan: "Plan") -> Vehicle:
    """Return the vehicle of `plan`."""
    vehicle = plan.vehicle
    source = f"{plan.source}: vehicle.parameters"
    return Vehicle(vehicle.autopilot, vehicle.type, vehicle.parameters, source)
