"""What a flight model is, what it is asked and answers, and how it steps from one to the other.

An autopilot's guidance says what it aims at; what the aircraft makes of that is here. Places,
velocities and accelerations across the ground are complex in steps: east + i north, in m and s.
"""

import math
from abc import ABC, abstractmethod
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faao_mav.arrays import Complex, Flags, Real
from faao_mav.autopilot.body import CopterBody
from faao_mav.autopilot.parameter import Parameter, ParameterValues, in_si
from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame
from faao_mav.vector import Vector

LONGEST = 21_600.0
"""The longest flight that is followed, s. Chosen: fuzzing took one of almost a day beyond 500 MB of
memory, which six hours stay below."""


STEP = 0.1  # The longest step of a flight, s: the one that the models were calibrated with.
SHORTEST = 2e-3  # The shortest step towards a waypoint, s. Chosen.
TINY = 1e-9  # What is shorter, m, has no direction.


def unit(way: complex) -> complex:
    """Return the direction of `way`, 0 for none."""
    return way / abs(way) if abs(way) > TINY else 0j


@dataclass(frozen=True, slots=True)
class Orbit:
    """A circle about the place of an item: `radius`, m, and the greatest `turn_rate`, rad/s.

    It is flown for so many `turns`, or for so many `seconds`; if it `climbs` until it is at its
    height, and if it is `endless` for good, of which `turns` are predicted. `clockwise` as seen
    from above; left from where it ends if `tangent`, else along the line from the middle.
    """

    radius: float
    clockwise: bool
    turns: float = 0.0
    seconds: float = 0.0
    climbs: bool = False
    endless: bool = False
    tangent: bool = False
    turn_rate: float = math.inf

    def speed(self, commanded: float) -> float:
        """Return the speed along the circle, m/s, where `commanded` is flown on straights."""
        return min(commanded, self.turn_rate * self.radius)

    def lasting(self, commanded: float) -> float:
        """Return how long it is flown, s, without the climb of one that does."""
        return max(self.turns * 2 * math.pi * self.radius / self.speed(commanded), self.seconds)

    def edge(self, center: complex, towards: complex) -> complex:
        """Return the place of the circle about `center` that is nearest to `towards`, m."""
        return center + self.radius * (unit(towards - center) or 1j)

    def outline(self, center: complex, corners: int = 72) -> Complex:
        """Return a closed polygon (corners + 1,) around the circle about `center`, m."""
        angle = np.linspace(0.0, 2 * np.pi, corners + 1)
        wide = self.radius / math.cos(np.pi / corners)
        return np.asarray(center + 1j * wide * np.exp(-1j * angle))


@dataclass(frozen=True, slots=True, eq=False)
class FlightPath:
    """Legs flown one after the other, from rest at the first point and to rest at the last.

    `points` (m, 3) are east, north, up in metres, m >= 1. `speeds` (m - 1,), m/s, are the ground
    speeds commanded for the leg that ends at point k + 1, in force from that leg's start. `holds`
    (m,), s, say how long the aircraft waits at each point: what is left of it once the autopilot
    has stored it. `splines` (m,) marks points that are spline waypoints; `radii` (m,), m, are
    acceptance radii, 0 for the autopilot's own. A flight that turns out to take more than
    `longest`, s, need not be followed to its end: `InputError`.

    Heights count from `elevation`, m above sea level. The air moves at `wind`, east and north, m/s,
    steadily and everywhere. An aeroplane comes over the first point at the velocity `entry` (3,),
    m/s, where one is given, and circles about the points that have one of `orbits`.
    """

    points: Real
    speeds: Real
    holds: Real
    splines: NDArray[np.bool_]
    radii: Real
    longest: float = LONGEST
    elevation: float = 0.0
    entry: Real | None = None
    wind: Vector = (0.0, 0.0)
    orbits: Mapping[int, Orbit] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Flown:
    """How a `FlightPath` is flown: time counts from the start at the first point.

    `arrivals` and `departures` (m,), s, are when the autopilot takes each point as reached, and
    when it leaves for the next; `departures[-1]` is the end. `t` (k,), s, is uniform from 0 to at
    least the end; `position` and `velocity` (k, 3) are east, north, up, metres and m/s.
    """

    arrivals: Real
    departures: Real
    t: Real
    position: Real
    velocity: Real


_GROUND = 0.5  # A flight that ends lower, m above home, has landed. Chosen.


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """The predicted flight of a whole mission.

    `t` (n,), s, counts from the start of the mission; `position` (n, 3) and `velocity` (n, 3) are
    east, north, up in metres about `frame`'s origin (up: above home) and m/s; `item` (n,) is the
    index into `Mission.items` of the item under way. `reached` (items,), s, is when each item was
    done, NaN for items that take no time of their own or never end.

    >>> from faao_mav import Vehicle, predict, read_mission
    >>> track = predict(read_mission("tests/data/missions/plain.waypoints"), Vehicle())
    >>> track.position.shape == track.velocity.shape == (len(track.t), 3)
    True
    """

    t: Real
    position: Real
    velocity: Real
    item: NDArray[np.int_]
    reached: Real
    frame: LocalFrame

    def __repr__(self) -> str:
        """Say how long it lasts, in a line."""
        return f"<Track: {self.t[-1]:.1f} s in {len(self.t)} instants>"

    @property
    def lands(self) -> bool:
        """Whether the flight ends on the ground."""
        return bool(self.position[-1, 2] < _GROUND)

    def within(self, frame: LocalFrame) -> Real:
        """Return the positions (n, 3), m, in another `frame`."""
        if self.frame == frame:
            return self.position
        ground = frame.to_local(*self.frame.to_geodetic(self.position[:, :2]))
        return np.column_stack([ground, self.position[:, 2]])


@dataclass(frozen=True, slots=True)
class SpeedRates:
    """How fast a vehicle's true airspeed V is made to change at most.

    It falls by at most `fall`, m/s², and rises by `power` / V, with the `power` in m²/s³: W per kg.
    Its guidance follows turns of at most `turn`, rad/s.
    """

    fall: float = math.inf
    power: float = math.inf
    turn: float = math.inf


class LegDurations(Protocol):
    """How long the legs (m - 1,) of a route take, from passing one end to passing the other."""

    @property
    def most(self) -> Real:
        """The greatest commands that make a difference, (m - 1,), m/s."""

    def flown(self, speeds: Real) -> tuple[Real, Real]:
        """Return the speeds, m/s, that legs come to at the commands `speeds`, and durations, s.

        Both have the shape of `speeds` (..., m - 1), m/s.
        """


def parameter(
    unit: str,
    default: float,
    new: str,
    old: str = "",
    factor: float = 0.01,
    *,
    least: float = 0.1,
    greatest: float = math.inf,
    capped_by: str = "",
) -> Any:
    """Declare a field of a `Model`: a parameter whose key is the name of the field.

    Its `new` name has the `unit`, and the `old` one `factor` times it; angles are in degrees.
    """
    names = {new: 1.0, old: factor} if old else {new: 1.0}
    row = in_si(unit, names, float(default), least, greatest, capped_by=capped_by)
    return field(default=row.default, metadata={"row": row})


class Model(ABC):
    """How a vehicle flies: base of dataclasses of SI units whose fields are its parameters.

    A field `body` is the airframe, `latitude` that of the flight, degrees. Legs shorter than
    `least`, m, are not flown: both their ends count as reached at once. `slowest` is the least
    speed, m/s, that is commanded for a leg: who has more time waits at its end. `run_in` is the leg
    before a start at speed, as a multiple of the shortest leg for that speed.
    """

    __slots__ = ()
    least: ClassVar[float]
    slowest: ClassVar[float]
    run_in: ClassVar[float] = 1.2
    cruise_speed: float

    @classmethod
    def parameters(cls) -> Iterator[Parameter]:
        """Yield the parameters that are fields."""
        for each in fields(cls):  # type: ignore[arg-type]
            if each.metadata:
                yield replace(each.metadata["row"], key=each.name)

    @classmethod
    def from_vehicle(cls, vehicle: ParameterValues, latitude: float | None = None) -> Self:
        """Return the values that `vehicle` has, for a flight at the `latitude`, degrees.

        Raises `InputError` for a parameter that is no use.
        """
        values: dict[str, Any] = {each.key: vehicle.value(each.key) for each in cls.parameters()}
        beside = {"body": vehicle.airframe, "latitude": latitude}
        known = {key: x for key, x in beside.items() if x is not None and hasattr(cls, key)}
        return cls(**values, **known)

    @abstractmethod
    def fly(self, path: FlightPath, step: float = 0.1) -> Flown:
        """Return the predicted flight along `path`, sampled every `step` seconds."""

    @abstractmethod
    def shortest_leg(self, speed: Real) -> Real:
        """Return the least length of a leg on which `speed`, m/s, is reached, m; same shape."""

    def radii(self, room: Real, turn: Real, stops: Flags) -> Real:  # noqa: ARG002
        """Return acceptance radii, m, that suit waypoints; 0 leaves them to the autopilot.

        `room` (n,), m, is the shorter of the legs at each waypoint that do not end at a stop,
        `turn` (n,) the angle between them, rad; `stops` (n,) marks the waypoints at which it waits.
        """
        return np.zeros_like(turn)

    def leg_durations(self, lengths: Real, joined: Flags) -> LegDurations | None:  # noqa: ARG002
        """Return how long straight legs of `lengths`, m, take; None if only a flight tells.

        `joined` marks those that follow one without a stop.
        """
        return None

    def true_over_commanded(self, altitude: float) -> float:  # noqa: ARG002
        """Return true airspeed over the one that a mission commands, `altitude` m above the sea.

        It is 1 where missions command ground speeds.
        """
        return 1.0

    @property
    def speed_rates(self) -> SpeedRates:
        """How fast its airspeed changes; infinitely if that is its acceleration's."""
        return SpeedRates()


class Copter:
    """A copter that leans with a lag, and at which the air drags, which moves at `wind`, m/s.

    `lean`, m/s², is what leaning gives; it begins in a hover, held against the wind. The air drags
    along the `nose`, a direction, and across, each by k v + q v |v|, as in ArduPilot's simulator.
    """

    def __init__(self, body: CopterBody, place: complex, wind: complex = 0j) -> None:
        self.place, self.velocity, self.acceleration = place, 0j, 0j
        self._body, self._wind, self.nose = body, wind, 1j
        self.lean = self.drag()

    def move(self, asked: complex, step: float) -> None:
        """Fly on for `step` seconds with the acceleration `asked`, m/s²."""
        self.lean += (asked - self.lean) * -math.expm1(-step / self._body.lag)
        self.acceleration = self.lean - self.drag()
        change = self.acceleration * step
        self.place += (self.velocity + change / 2) * step
        self.velocity += change

    def drag(self) -> complex:
        """Return the deceleration by the air, m/s²."""
        air = (self.velocity - self._wind) * self.nose.conjugate()
        k, q, along, across = self._body.linear_drag, self._body.quadratic_drag, air.real, air.imag
        return self.nose * complex((k + q * abs(along)) * along, (k + q * abs(across)) * across)


class Flight:
    """A flight that has taken `time`, s, so far, with samples of where it was and how fast."""

    def __init__(self, longest: float) -> None:
        self.time = 0.0
        self._log, self._longest = array("d"), longest

    def keep(self, place: complex, height: float, velocity: complex, climb: float) -> None:
        """Keep a sample; raises `InputError` after the longest time that is followed, s."""
        if self.time > self._longest:
            raise InputError(
                f"the flight would take more than {self._longest:.0f} s, perhaps for the wind, or "
                "for a waypoint that is never reached"
            )
        sample = self.time, place.real, place.imag, height, velocity.real, velocity.imag, climb
        self._log.extend(sample)

    def flown(self, arrivals: ArrayLike, departures: ArrayLike, step: float) -> Flown:
        """Return the flight every `step` seconds up to its end."""
        log, left = np.frombuffer(self._log).reshape(-1, 7), np.asarray(departures)
        t = np.arange(math.ceil(left[-1] / step - 1e-9) + 1, dtype=float) * step
        columns = [np.interp(t, log[:, 0], column) for column in log[:, 1:].T]
        position, velocity = np.stack(columns[:3], axis=-1), np.stack(columns[3:], axis=-1)
        return Flown(np.asarray(arrivals), left, t, position, velocity)
