"""What the plan says of the aircraft, its power and its battery: `vehicle`."""

from collections.abc import Mapping
from dataclasses import asdict, field, fields
from typing import Annotated, Any, TypeAlias

from pydantic import BeforeValidator, PlainValidator, TypeAdapter, ValidationInfo

from faao_mav.autopilot import autopilots, kinds, vehicle_type
from faao_mav.autopilot.body import Body, CopterBody, PlaneBody
from faao_mav.errors import InputError
from faao_mav.plan.fields import DEFAULTS, Number, listed, one_of, section, told
from faao_mav.power import GRAVITY, FixedWing, PowerModel, RotaryWing

_COPTER_MASS, _PLANE_MASS = 20 / GRAVITY, 10.0
"""The masses of the aircraft of the papers, kg: the copter of 2019 weighs 20 N."""


def _percent(value: object) -> object:
    """Return the number of `20 %`, which YAML reads as text; anything else as it is."""
    number = value.removesuffix("%").strip() if isinstance(value, str) else ""
    return float(number) if number.replace(".", "", 1).isdecimal() else value


@section
class PowerOptions:
    """The power that flight takes: from measured power, or from what the aircraft is.

    The defaults are those of the aircraft of the papers.
    """

    hover_w: Number | None = None
    cruise_w: Number | None = None
    at: Number | None = None
    mass: Number | None = None
    rotor_area: Number = 0.503
    solidity: Number = 0.05
    tip_speed: Number = 120.0
    drag_ratio: Number = 0.6
    air_density: Number = 1.225
    c1: Number = 9.26e-4
    c2: Number = 2250.0

    def model(self, *, hovers: bool) -> PowerModel:
        """Return the power of an aircraft that `hovers`, or of a plane."""
        if not hovers:
            mass = self.mass or _PLANE_MASS
            if self.cruise_w is not None and self.at is not None:
                return FixedWing.fitted(self.cruise_w, self.at, mass)
            return FixedWing(self.c1, self.c2, mass)
        names = ("rotor_area", "solidity", "tip_speed", "drag_ratio", "air_density")
        shape = {name: getattr(self, name) for name in names}
        model = RotaryWing.of(mass=self.mass or _COPTER_MASS, **shape)
        if self.hover_w is None or self.cruise_w is None or self.at is None:
            return model
        return model.fitted(self.hover_w, self.cruise_w, self.at)


@section
class Battery:
    """The battery that the whole mission is held against (needs `vehicle.power`)."""

    capacity_wh: Number
    reserve: Annotated[Number, BeforeValidator(_percent)] = 20.0

    @property
    def usable(self) -> float:
        """The energy above the reserve, Wh."""
        return self.capacity_wh * (1 - self.reserve / 100)


AutopilotName: TypeAlias = Annotated[str, one_of(autopilots), autopilots]
KindName: TypeAlias = Annotated[str, one_of(kinds), kinds]


def _body_of(value: object, info: ValidationInfo) -> Body | None:
    """Return `vehicle.body` of a plan: numbers over those of the simulator; None where all are."""
    try:
        known = vehicle_type(info.data.get("autopilot", ""), info.data.get("type", ""))
    except InputError:  # an unknown name is told by itself
        return None
    if value in (None, "sitl"):
        return None
    if not isinstance(value, dict):
        raise ValueError("neither sitl nor a mapping")
    if known.body is None:
        raise told(f"no flight model of {known.family.key} {known.kind} reads it; give sitl")
    own: dict[str, Any] = asdict(known.body)
    if other := [name for name in value if name in _NUMBERS and name not in own]:
        raise told(f"{other[0]} is not of a {known.kind}'s body, which has {listed([*own], 'and')}")
    body = TypeAdapter(type(known.body)).validate_python({**own, **value})
    return body if body != known.body else None


_NUMBERS = {each.name for body in (CopterBody, PlaneBody) for each in fields(body)}
"""The names of all numbers of all airframes."""


@section
class VehicleOptions:
    """The aircraft and its limits."""

    autopilot: AutopilotName = "ardupilot"
    type: KindName = "copter"
    max_speed: Number
    max_acceleration: Number
    min_speed: Number = 0.0
    max_airspeed: Number | None = None
    parameters: Mapping[str, Number] = field(default_factory=DEFAULTS)
    body: Annotated[Body | None, PlainValidator(_body_of)] = None
    power: PowerOptions | None = None
    battery: Battery | None = None
