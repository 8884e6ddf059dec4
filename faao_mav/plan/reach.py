"""How far an aircraft gets in a given number of steps, and how long a distance takes."""

import math

import numpy as np

from faao_mav.plan.model import Flight, Vector, Vehicle


def reach(steps: int, flight: Flight, vehicle: Vehicle) -> float:
    """Return the farthest w(N+1) - w(0) along the line from start to end, m.

    Under (11)-(13f) the component of v(n) along any direction is at most
    min(v_0 + n a dt, v_end + (steps - n) a dt, v_max), and a straight flight attains that bound
    when the end velocities are zero or free. With end velocities across the line the result is
    only an upper bound. `steps` is N + 1; a displacement is the trapezoid sum of v.
    """
    dt, limit = flight.time_step, vehicle.max_speed
    gain = vehicle.max_acceleration * dt
    direction = _direction(flight)
    n = np.arange(steps + 1, dtype=float)
    speed = np.full(steps + 1, limit)
    if flight.start_velocity is not None:
        first = math.fsum(v * d for v, d in zip(flight.start_velocity, direction, strict=True))
        if flight.bound_first_acceleration:
            np.minimum(speed, first + n * gain, out=speed)
        speed[0] = min(first, limit)
    if flight.end_velocity is not None:
        last = math.fsum(v * d for v, d in zip(flight.end_velocity, direction, strict=True))
        np.minimum(speed, last + n[::-1] * gain, out=speed)
    return float(dt * (speed[:-1] + speed[1:]).sum() / 2)


def shortest_duration(flight: Flight, vehicle: Vehicle, max_slots: int) -> float | None:
    """Return the least T = (N + 2) dt whose reach covers the distance, s; None past `max_slots`."""
    distance = math.dist(flight.start, flight.end)

    def enough(slots: int) -> bool:
        return reach(slots - 1, flight, vehicle) >= distance

    low, high = 2, 4
    while not enough(high):
        low, high = high, 2 * high
        if high > 2 * max_slots:
            return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high * flight.time_step


def _direction(flight: Flight) -> Vector:
    east, north = (b - a for a, b in zip(flight.start, flight.end, strict=True))
    distance = math.hypot(east, north)
    return (east / distance, north / distance) if distance else (0.0, 0.0)
