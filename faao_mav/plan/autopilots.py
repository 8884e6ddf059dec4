"""The vehicles that a plan can name: `vehicle.autopilot` and `vehicle.type`.

The plan knows their names and the facts that decide whether a plan makes sense for them. What
each vehicle is stands in `faao_mav.vehicle`, whose `register` adds to this table; a test holds both
to the same facts.
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

Autopilot: TypeAlias = str
"""The name of an autopilot, as `vehicle.autopilot` of a plan has it."""

Kind: TypeAlias = str
"""The name of a type of vehicle, as `vehicle.type` of a plan has it."""


@dataclass(frozen=True, slots=True)
class PlannedVehicle:
    """A vehicle that a plan can name.

    `hovers`: it can fly at 0 m/s. `planned`: missions are made for it; the missions of the others
    can be validated, converted and uploaded. `any_inclusion`: its fence asks for one of several
    inclusions, not for all of them. ArduPilot's FENCE_OPTIONS may ask for one, too; a plan for it
    keeps inside all, which is right either way. `max_airspeed`, m/s, is what it holds in wind with
    its own parameters; infinite where `vehicle.max_speed` says it.
    """

    autopilot: str
    type: str
    hovers: bool = True
    planned: bool = True
    any_inclusion: bool = False
    max_airspeed: float = math.inf


VEHICLES: dict[tuple[str, str], PlannedVehicle] = {
    (vehicle.autopilot, vehicle.type): vehicle
    for vehicle in (
        PlannedVehicle("ardupilot", "copter", max_airspeed=9.27),
        PlannedVehicle("ardupilot", "plane", hovers=False),
        PlannedVehicle("px4", "copter", any_inclusion=True, max_airspeed=44.13),
        PlannedVehicle("px4", "plane", hovers=False, planned=False, any_inclusion=True),
    )
}
"""The vehicles by autopilot and type, in the order in which error messages list them."""


def autopilots() -> tuple[str, ...]:
    """Return the names that `vehicle.autopilot` may have.

    >>> autopilots()
    ('ardupilot', 'px4')
    """
    return tuple(dict.fromkeys(autopilot for autopilot, _ in VEHICLES))


def types() -> tuple[str, ...]:
    """Return the names that `vehicle.type` may have.

    >>> types()
    ('copter', 'plane')
    """
    return tuple(dict.fromkeys(kind for _, kind in VEHICLES))
