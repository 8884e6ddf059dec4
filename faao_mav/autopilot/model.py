"""How a vehicle with given parameters flies: what each vehicle's model answers."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from math import inf
from typing import Any, ClassVar, Protocol, Self

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.flight_path import FlightPath, Flown
from faao_mav.autopilot.parameter import Parameter, ParameterValues, row


@dataclass(frozen=True, slots=True)
class SpeedRates:
    """How fast a vehicle's true airspeed V is made to change at most.

    It falls by at most `fall`, m/s², and rises by `power` / V, with the `power` in m²/s³: W per kg.
    Its guidance follows turns of at most `turn`, rad/s.
    """

    fall: float = inf
    power: float = inf
    turn: float = inf


class LegDurations(Protocol):
    """How long the legs (m - 1,) of a route take, from passing one end to passing the other."""

    @property
    def most(self) -> Real:
        """The greatest commands that make a difference, (m - 1,), m/s."""

    def flown(self, speeds: Real) -> tuple[Real, Real]:
        """Return the speeds, m/s, that legs come to at the commands `speeds`, and durations, s.

        Both have the shape of `speeds` (..., m - 1), m/s.
        """


def parameter(*told: Any, **more: Any) -> Any:
    """Declare a field of a `Model`: a `row` whose key is the name of the field."""
    declared = row("", *told, **more)
    return field(default=declared.default, metadata={"row": declared})


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

    def corner_speed(self, turn: float) -> float | None:  # noqa: ARG002
        """Return the speed, m/s, at which it passes a waypoint where it turns by `turn`, rad.

        None if no such law is known.
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
