"""The vehicles that a plan can name: `vehicle.autopilot` and `vehicle.type`.

The plan knows their names and the facts that decide whether a plan makes sense for them. What
each vehicle is stands in `faao_mav.autopilot`, whose `register` adds to this table; a test holds
both to the same facts.
"""

import math
from dataclasses import asdict, dataclass, fields
from typing import Annotated, Any, TypeAlias

from pydantic import TypeAdapter, ValidationInfo

from faao_mav.plan.body import (
    ARDUCOPTER_BODY,
    ARDUPLANE_BODY,
    PX4_BODY,
    Body,
    CopterBody,
    PlaneBody,
)
from faao_mav.plan.fields import Written, listed, one_of, told

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
    keeps inside all, which is right either way. `body` is the airframe of its autopilot's
    simulator, None where no flight model has one; `lean_angle`, rad, the default of a copter's lean
    limit, 0 for none.
    """

    autopilot: str
    type: str
    hovers: bool = True
    planned: bool = True
    any_inclusion: bool = False
    body: Body | None = None
    lean_angle: float = 0.0

    def max_airspeed(self, body: Body | None) -> float:
        """Return what it holds in wind with its own parameters and this `body`, m/s.

        Infinite where `vehicle.max_speed` says it.
        """
        if not isinstance(body, CopterBody) or self.lean_angle == 0:
            return math.inf
        return body.held_airspeed(self.lean_angle)


VEHICLES: dict[tuple[str, str], PlannedVehicle] = {
    (vehicle.autopilot, vehicle.type): vehicle
    for vehicle in (
        PlannedVehicle("ardupilot", "copter", body=ARDUCOPTER_BODY, lean_angle=math.radians(30)),
        PlannedVehicle("ardupilot", "plane", hovers=False, body=ARDUPLANE_BODY),
        PlannedVehicle(
            "px4", "copter", any_inclusion=True, body=PX4_BODY, lean_angle=math.radians(45)
        ),
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


AutopilotName: TypeAlias = Annotated[
    Autopilot, one_of(autopilots), Written(lambda: listed(autopilots()))
]
TypeName: TypeAlias = Annotated[Kind, one_of(types), Written(lambda: listed(types()))]


def body_of(value: object, info: ValidationInfo) -> Body | None:
    """Return `vehicle.body` of a plan: numbers over those of the simulator; None where all are."""
    vehicle = VEHICLES.get((info.data.get("autopilot", ""), info.data.get("type", "")))
    if value in (None, "sitl") or vehicle is None:  # an unknown name is told by itself
        return None
    if not isinstance(value, dict):
        raise ValueError("neither sitl nor a mapping")
    if vehicle.body is None:
        raise told(f"no flight model of {vehicle.autopilot} {vehicle.type} reads it; give sitl")
    own: dict[str, Any] = asdict(vehicle.body)
    if foreign := [name for name in value if name in _NUMBERS and name not in own]:
        raise told(
            f"{foreign[0]} is not of a {vehicle.type}'s body, which has {listed([*own], 'and')}"
        )
    body = TypeAdapter(type(vehicle.body)).validate_python({**own, **value})
    return body if body != vehicle.body else None


_NUMBERS = {each.name for body in (CopterBody, PlaneBody) for each in fields(body)}
"""The names of all numbers of all airframes."""
