"""What the plan says of power and battery: `vehicle.power` and `vehicle.battery`."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import BeforeValidator

from faao_mav.plan.fields import Number, Section, key
from faao_mav.power import GRAVITY, FixedWing, PowerModel, RotaryWing

_COPTER_MASS, _PLANE_MASS = 20 / GRAVITY, 10.0
"""The masses of the aircraft of the papers, kg: the copter of 2019 weighs 20 N."""


def _percent(value: object) -> object:
    """Return the number of `20 %`, which YAML reads as text; anything else as it is."""
    number = value.removesuffix("%").strip() if isinstance(value, str) else ""
    return float(number) if number.replace(".", "", 1).isdecimal() else value


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerOptions(Section):
    """The power that flight takes: from measured power, or from what the aircraft is.

    The defaults are those of the aircraft of the papers.
    """

    hover_w: Annotated[
        Number | None, key("Copter: power in hover; with cruise_w and at.", "W", gt=0, le=1e6)
    ] = None
    cruise_w: Annotated[
        Number | None,
        key("Power at the airspeed `at`; of a plane at that of longest range.", "W", gt=0, le=1e6),
    ] = None
    at: Annotated[Number | None, key("Airspeed of cruise_w.", "m/s", gt=0, le=1000)] = None
    mass: Annotated[
        Number | None,
        key("Mass; null: 2.039 kg for copters, 10 kg for planes.", "kg", gt=0, le=1e5),
    ] = None
    rotor_area: Annotated[Number, key("Copter: area of all rotor discs.", "m^2", gt=0, le=1e4)] = (
        0.503
    )
    solidity: Annotated[Number, key("Copter: area of blades by that of discs.", gt=0, le=1)] = 0.05
    tip_speed: Annotated[Number, key("Copter: speed of blade tips.", "m/s", gt=0, le=400)] = 120.0
    drag_ratio: Annotated[Number, key("Copter: fuselage drag ratio d_0.", ge=0, le=1000)] = 0.6
    air_density: Annotated[Number, key("Copter: density of the air.", "kg/m^3", gt=0, le=2)] = 1.225
    c1: Annotated[Number, key("Plane: factor of v^3.", "W s^3/m^3", gt=0, le=1e6)] = 9.26e-4
    c2: Annotated[Number, key("Plane: factor of 1 / v.", "W m/s", gt=0, le=1e9)] = 2250.0

    def model(self, *, hovers: bool) -> PowerModel:
        """Return the power of an aircraft that `hovers`, or of a plane."""
        if not hovers:
            mass = self.mass or _PLANE_MASS
            if self.cruise_w is not None and self.at is not None:
                return FixedWing.fitted(self.cruise_w, self.at, mass)
            return FixedWing(self.c1, self.c2, mass)
        model = RotaryWing.of(
            mass=self.mass or _COPTER_MASS,
            rotor_area=self.rotor_area,
            solidity=self.solidity,
            tip_speed=self.tip_speed,
            drag_ratio=self.drag_ratio,
            air_density=self.air_density,
        )
        if self.hover_w is None or self.cruise_w is None or self.at is None:
            return model
        return model.fitted(self.hover_w, self.cruise_w, self.at)


@dataclass(frozen=True, slots=True, kw_only=True)
class Battery(Section):
    """The battery that the whole mission is held against (needs `vehicle.power`)."""

    capacity_wh: Annotated[Number, key("Energy of the full battery.", "Wh", gt=0, le=1e6)]
    reserve: Annotated[
        Number,
        BeforeValidator(_percent),
        key("Share that has to be left after landing.", "%", "a percentage, 0 to 99", ge=0, le=99),
    ] = 20.0

    @property
    def usable(self) -> float:
        """The energy above the reserve, Wh."""
        return self.capacity_wh * (1 - self.reserve / 100)
