"""A vehicle: its type and the parameters that it is given; and the types that are known.

Another vehicle is one module or folder with one `VehicleType` and one call of `register`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot.body import Body, CopterBody, density_ratio
from faao_mav.autopilot.model import Model, Orbit
from faao_mav.autopilot.vehicle_type import AutopilotFamily, VehicleType, lean_acceleration
from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import ABOVE_SEA, Command, Frame
from faao_mav.mission.item import Home, Mission, MissionItem

_TYPES: dict[tuple[str, str], VehicleType] = {}
"""The vehicle types that are known, by the names of autopilot and type."""

_HELD = 0.9
"""The greatest airspeed that a plan asks of a copter, in that at which drag takes all of its lean
limit. Measured, in ArduCopter's simulator: see docs/benchmarks.md."""


LANDING_HEIGHT = 10.0
"""The height above the ground, m, from which a landing goes on at the landing speed.
Chosen: ArduCopter's own by default."""


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A vehicle, named as in a plan, with parameters by its autopilot's names and in its units.

    Parameters that are not given have the autopilot's defaults. `source` says where the parameters
    come from, for error messages. `body` is its airframe, None for the simulator's. Methods raise
    `InputError` for a parameter that is no use, naming source, parameter and value; `usable`
    returns the vehicle without those.

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
    body: Body | None = None

    @property
    def airframe(self) -> Body | None:
        """The airframe that its flights are predicted with; None where its type has none."""
        return self.body or self.type.body

    @property
    def assumption(self) -> str:
        """What its predicted flights rest on, in words."""
        if self.airframe is None:
            return "by a model after the autopilot's documents, not compared with recorded flights"
        if self.body is not None:
            return "assumes the airframe of vehicle.body"
        return "assumes the simulator's airframe (vehicle.body: sitl)"

    @property
    def top_airspeed(self) -> float:
        """The airspeed, m/s, at which drag takes all of its lean limit; infinite if none does."""
        body = self.airframe
        if not isinstance(body, CopterBody) or "lean_angle" not in self.type.parameters:
            return math.inf
        return body.top_airspeed(self.value("lean_angle"))

    @property
    def held_airspeed(self) -> float:
        """The greatest airspeed, m/s, that it holds in wind with room to correct."""
        return round(_HELD * self.top_airspeed, 2)

    @property
    def type(self) -> VehicleType:
        """What is true of all vehicles of this autopilot and type."""
        return vehicle_type(self.autopilot, self.kind)

    def value(self, key: str, otherwise: float | None = None) -> float:
        """Return the value of the parameter `key` in its table's unit: given, else the default.

        Of a vehicle that has no such parameter it is `otherwise`, if that is given.
        """
        if otherwise is not None and key not in self.type.parameters:
            return otherwise
        return self._told(key)[0]

    def name_of(self, key: str) -> str:
        """Return the name by which `value(key)` is set, and that it is a default if it is."""
        return self._told(key)[1]

    def _told(self, key: str) -> tuple[float, str]:
        """Return the value of a parameter, and what sets it."""
        parameter = self.type.parameters[key]
        name = parameter.name_in(self.parameters)
        told = parameter.default, f"{parameter.newest_name}, its default"
        if name is not None:
            number = self.parameters[name]
            if not parameter.is_usable(number, name):
                expected = parameter.expected(name)
                raise InputError(f"{self.source}: {name}: {number:g}; give {expected}")
            told = parameter.names[name] * number, name
        if parameter.capped_by:
            told = min(told, self._told(parameter.capped_by), key=lambda each: each[0])
        return told

    def having(self, key: str, value: float) -> "Vehicle":
        """Return the vehicle with another `value` of the parameter `key`, at least its least."""
        parameter = self.type.parameters[key]
        name = parameter.newest_name
        number = max(value, parameter.least) / parameter.names[name]
        return replace(self, parameters={**self.parameters, name: number})

    def usable(self) -> "Vehicle":
        """Return the vehicle without the parameters that are no use: those have their defaults."""
        given = self.parameters
        useless = {
            name
            for each in self.type.parameters.values()
            for name in each.names
            if name in given and not each.is_usable(given[name], name)
        }
        kept = {name: number for name, number in given.items() if name not in useless}
        return replace(self, parameters=kept) if useless else self

    def climb_time(self, height: float, *, take_off: bool = False) -> float:
        """Return how long a climb of `height`, m, takes from rest to rest, s; or a take-off."""
        speed = self.value("climb_speed")
        if not take_off:
            return self._ramped(height, speed)
        return self.type.spool + self._ramped(height, self.value("take_off_speed", speed))

    def landing_time(self, height: float) -> float:
        """Return how long the way down to the ground takes from a `height`, m, s."""
        slow = min(max(height, 0.0), LANDING_HEIGHT)
        landing = slow / self.landing_speed
        return landing + self._ramped(height - slow, self.value("descent_speed"))

    @property
    def landing_speed(self) -> float:
        """The speed of the last `LANDING_HEIGHT` metres, m/s; a plane has no parameter for it."""
        return self.value("landing_speed", 0.5)

    def _ramped(self, height: float, speed: float) -> float:
        """Return how long it takes to climb or sink by `height`, m, at `speed`, m/s."""
        ramp = speed / self.value("climb_acceleration", 1.0)
        return height / speed + ramp if height > 0 else 0.0

    def returns_at(self, height: float) -> float:
        """Return the height, m above home, at which it returns from `height`."""
        told = self.value("return_height", 0.0)
        return max(height, told) if self.type.returns_at_least or told < 0 else told

    @property
    def fence_heights(self) -> tuple[float, float]:
        """The least and the greatest height above home, m, that its own fence lets it be at."""
        if "fence_height" in self.type.parameters:
            high = self.value("fence_height")
            return -math.inf, high if high > 0 else math.inf
        fenced = "fence_type" in self.type.parameters and self.value("fence_enable") != 0
        kinds = int(self.value("fence_type")) if fenced else 0
        return (
            self.value("fence_floor") if kinds & 8 else -math.inf,
            self.value("fence_ceiling") if kinds & 1 else math.inf,
        )

    def orbit(self, item: MissionItem, home: Home | None) -> Orbit | None:
        """Return how it circles at `item`, None where it does not; unknown heights count as 0."""
        ground = 0.0 if home is None or item.frame in ABOVE_SEA else home.altitude
        density = density_ratio(sum(filter(math.isfinite, (item.z, ground))))
        return self.type.orbits(self, self.type.dialect.sent(item), density)

    def waiting(self, home: Home | None, up: float) -> Orbit | None:
        """Return how it circles where it ends `up` m above `home`; None for what hovers there."""
        waits = MissionItem(Command.NAV_LOITER_UNLIM, Frame.GLOBAL_RELATIVE_ALT, z=up)
        return None if self.type.hovers else self.orbit(waits, home)

    def returns_to(self, mission: Mission, frame: LocalFrame, here: Real, home: Real) -> Real:
        """Return where and how high a return from `here` (3,), m in `frame`, goes, (3,).

        It goes to `home` (2 or more,), or to one of the mission's rally points, before it lands or
        circles there.
        """
        rule, level = self.type.rally(self), self.returns_at(float(here[2]))
        rally = [(frame.to_local(at.latitude, at.longitude), at.altitude) for at in mission.rally]

        def away(choice: tuple[Real, float]) -> float:
            return float(np.hypot(*(choice[0] - here[:2])))

        choices = [each for each in rally if away(each) <= rule.limit]
        if rule.home or not choices:
            choices.insert(0, (home[:2], math.nan))
        place, height = min(choices, key=away)
        if not math.isnan(height):
            level = max(level, height) if self.type.hovers else height
        return np.array([*place, level])

    def flight_model(self, latitude: float | None = None) -> Model:
        """Return how it flies at `latitude`, degrees.

        Raises `InputError` if there is no model of its type.
        """
        if self.type.flight_model is None:
            raise InputError(f"there is no model of how {self.type.name} flies {self.kind}s")
        return self.type.flight_model(self, latitude)

    def ceiling(self, key: str) -> tuple[float, str]:
        """Return how far a plan's "max_speed" or "max_acceleration" may go for it, and why.

        That is in m/s or m/s², infinite where nothing limits it.
        """
        limits = [(math.inf, "")]
        if key == "max_speed" and self.type.hovers:
            limits.append((self.type.fastest, "the most that it is told"))
        for own in self.type.ceilings.get(key, ()):
            value, angle = self.value(own), self.type.parameters[own].unit == "rad"
            limits.append((lean_acceleration(value) if angle else value, self.name_of(own)))
        return min(limits, key=lambda each: each[0])


def register(vehicle_type: VehicleType) -> VehicleType:
    """Make `vehicle_type` known by its names, to plans as well, and return it."""
    _TYPES[vehicle_type.family.key, vehicle_type.kind] = vehicle_type
    return vehicle_type


def unregister(vehicle_type: VehicleType) -> None:
    """Forget `vehicle_type`."""
    del _TYPES[vehicle_type.family.key, vehicle_type.kind]


def vehicle_types(kind: str | None = None) -> tuple[VehicleType, ...]:
    """Return every vehicle type that is known, or those of one `kind`."""
    return tuple(each for each in _TYPES.values() if kind in (None, each.kind))


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


def autopilots() -> tuple[str, ...]:
    """Return the names that `vehicle.autopilot` of a plan may have.

    >>> autopilots()
    ('ardupilot', 'px4')
    """
    return tuple(families())


def kinds() -> tuple[str, ...]:
    """Return the names that `vehicle.type` of a plan may have.

    >>> kinds()
    ('copter', 'plane')
    """
    return tuple(dict.fromkeys(each.kind for each in _TYPES.values()))


def families() -> dict[str, AutopilotFamily]:
    """Return every autopilot that is known, by its name."""
    return {each.family.key: each.family for each in _TYPES.values()}


def kind_by_number(mav_type: int | None) -> str | None:
    """Return the type of vehicle with this MAV_TYPE number, whatever its autopilot, or None."""
    return next((each.kind for each in _TYPES.values() if mav_type in each.mav_types), None)


def vehicle_type_by_numbers(mav_autopilot: int, mav_type: int | None) -> VehicleType | None:
    """Return the vehicle type with these MAV_AUTOPILOT and MAV_TYPE numbers.

    Without a MAV_TYPE it is the first type of that autopilot; None for numbers that are unknown.
    """
    own = (each for each in _TYPES.values() if each.family.mav_autopilot == mav_autopilot)
    return next((each for each in own if mav_type is None or mav_type in each.mav_types), None)
