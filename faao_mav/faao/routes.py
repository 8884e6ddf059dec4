"""Flights to start from: straight, and by way of the stations."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.faao.cruise import cruise_by
from faao_mav.faao.kinematics import Kinematics, Trajectory
from faao_mav.faao.start import even_speed, farthest, straight_flight

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

    def attempt(share: float) -> Trajectory | None:
        return _visit(kin, [a + share * (p - a) for a, p in zip(anchors, stations, strict=True)])

    whole = attempt(1.0)
    if whole is not None:
        return whole
    low, high, best = 0.0, 1.0, None
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        flight = attempt(middle)
        if flight is None:
            high = middle
        else:
            low, best = middle, flight
    return best if low >= _WORTHWHILE else None


def _nearest_on_line(a: Real, b: Real, p: Real) -> Real:
    line = b - a
    square = float(line @ line)
    share = min(1.0, max(0.0, float((p - a) @ line) / square)) if square else 0.0
    return np.asarray(a + share * line)


def _visit(kin: Kinematics, stops: list[Real]) -> Trajectory | None:
    """Straight legs from stop to stop as fast as allowed, with equal hovers at the stops."""
    points = [kin.start, *stops, kin.end]
    legs = []
    for k in range(len(points) - 1):
        last = k == len(points) - 2
        legs.append(
            replace(
                kin,
                start=points[k],
                end=points[k + 1],
                start_velocity=kin.start_velocity if k == 0 else np.zeros(2),
                end_velocity=kin.end_velocity if last else np.zeros(2),
                bound_first_acceleration=kin.bound_first_acceleration or k > 0,
            )
        )
    fitted = [_quickest(leg) for leg in legs]
    if any(leg is None for leg in fitted):
        return None
    profiles = [leg for leg in fitted if leg is not None]
    spare = kin.slots - 1 - sum(len(v) - 1 for v in profiles)
    if spare < 0:
        return None
    hovers = np.full(len(stops), spare // len(stops))
    hovers[: spare % len(stops)] += 1
    parts = [profiles[0]]
    for hover, profile in zip(hovers, profiles[1:], strict=True):
        parts += [np.zeros((hover, 2)), profile[1:]]
    v = np.vstack(parts)
    a = np.vstack([np.diff(v, axis=0) / kin.time_step, np.zeros(2)])
    return kin.integrate(v[0], a)


def _quickest(leg: Kinematics) -> Real | None:
    """Velocities (m, 2) of the quickest straight flight of `leg`, at most its slots long."""
    line = leg.end - leg.start
    distance = float(np.linalg.norm(line))
    direction = line / distance if distance else np.array([1.0, 0.0])
    across = np.array([-direction[1], direction[0]])
    for velocity in (leg.start_velocity, leg.end_velocity):
        if velocity is not None and abs(velocity @ across) > 1e-12 * leg.max_speed:
            return None
    low, high = 1, leg.slots
    if farthest(leg, direction) < distance:
        return None
    while high - low > 1:
        middle = (low + high) // 2
        if farthest(replace(leg, slots=middle), direction) >= distance:
            high = middle
        else:
            low = middle
    speed = even_speed(replace(leg, slots=high), direction, distance)
    return None if speed is None else speed[:, None] * direction
