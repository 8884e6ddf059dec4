"""Flights to start from: straight, and by way of the stations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.search.cruise import cruise_by
from faao_mav.optimizer.search.start import even_speed, fewest_slots, straight_flight

_BISECTIONS = 12
_WORTHWHILE = 0.02
"""Shares of the way to a station that are not worth a start of their own."""


def starts(
    kin: Kinematics, names: Sequence[str], stations: dict[str, Real]
) -> dict[str, Trajectory]:
    """Return the flights named: `straight`, or stations in the order of the visit, `bs-user`.

    A flight by way of stations goes as far towards them as the time allows, and spends what is
    left hovering there; with a least speed it goes all the way and circles there. Flights that
    cannot be had (no time at all, or end velocities across the way) are left out; if nothing is
    left, the straight one is returned.
    """
    found = {}
    for name in names:
        if name == "straight":
            found[name] = straight_flight(kin)
            continue
        stops = [stations[key] for key in name.split("-")]
        flight = cruise_by(kin, stops) if kin.min_speed > 0 else _by_way_of(kin, stops)
        if flight is not None:
            found[name] = flight
    return found or {"straight": straight_flight(kin)}


def _by_way_of(kin: Kinematics, stations: list[Real]) -> Trajectory | None:
    """The flight that goes the largest possible share of the way to `stations`."""
    anchors = [_nearest_on_line(kin.start, kin.end, p) for p in stations]

    def attempt(share: float) -> list[_Leg] | None:
        stops = [a + share * (p - a) for a, p in zip(anchors, stations, strict=True)]
        return _legs(kin, stops)

    low, high, best = 0.0, 1.0, attempt(1.0)
    if best is not None:
        return _flown(kin, best)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        legs = attempt(middle)
        if legs is None:
            high = middle
        else:
            low, best = middle, legs
    return _flown(kin, best) if best is not None and low >= _WORTHWHILE else None


def _nearest_on_line(a: Real, b: Real, p: Real) -> Real:
    line = b - a
    square = float(line @ line)
    share = min(1.0, max(0.0, float((p - a) @ line) / square)) if square else 0.0
    return np.asarray(a + share * line)


@dataclass(frozen=True, slots=True)
class _Leg:
    """A straight flight `distance` metres along `direction`, in the fewest slots it takes."""

    kin: Kinematics
    direction: Real
    distance: float


def _legs(kin: Kinematics, stops: list[Real]) -> list[_Leg] | None:
    """The legs from stop to stop as fast as allowed; None if they take more than the time."""
    points = [kin.start, *stops, kin.end]
    legs, spare = [], kin.slots - 1
    for k in range(len(points) - 1):
        first, last = k == 0, k == len(points) - 2
        leg = replace(
            kin,
            start=points[k],
            end=points[k + 1],
            start_velocity=kin.start_velocity if first else np.zeros(2),
            end_velocity=kin.end_velocity if last else np.zeros(2),
            bound_first_acceleration=kin.bound_first_acceleration or not first,
        )
        line = leg.end - leg.start
        distance = float(np.hypot(*line))
        direction = line / distance if distance else np.array([1.0, 0.0])
        across = np.array([-direction[1], direction[0]])
        for velocity in (leg.start_velocity, leg.end_velocity):
            if velocity is not None and abs(velocity @ across) > 1e-12 * leg.max_speed:
                return None
        slots = fewest_slots(leg, direction, distance)
        if slots is None or slots - 1 > spare:
            return None
        spare -= slots - 1
        legs.append(_Leg(replace(leg, slots=slots), direction, distance))
    return legs


def _flown(kin: Kinematics, legs: list[_Leg]) -> Trajectory | None:
    """The flight along `legs`, with equal hovers between them for the time that is left."""
    parts = []
    for leg in legs:
        speed = even_speed(leg.kin, leg.direction, leg.distance)
        if speed is None:
            return None
        parts.append(speed[:, None] * leg.direction)
    stops = len(legs) - 1
    spare = kin.slots - 1 - sum(len(v) - 1 for v in parts)
    for k in range(stops):
        hover = spare // stops + (k < spare % stops)
        parts[k + 1] = np.vstack([np.zeros((hover, 2)), parts[k + 1][1:]])
    return kin.follow(np.vstack(parts))
