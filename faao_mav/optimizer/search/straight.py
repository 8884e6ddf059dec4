"""Feasible flights along straight lines: at the most even speed, or quick with stops between."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.search.cruise import cruise
from faao_mav.optimizer.search.track import nearest_flight

_EAST = np.array([1.0, 0.0])
"""The direction of a line of no length."""

_ALONG = 1e-12
"""The velocity across a line, in shares of v_max, that counts as none: rounding errors."""


def straight_flight(kin: Kinematics) -> Trajectory:
    """Return a feasible flight along the line from w_I to w_F, at the most even speed.

    Where end velocities do not lie on that line, it is the nearest flight to it; where the line is
    too short for the least speed, one with detours (see `cruise`).

    Raises:
        InfeasibleError: there is no feasible flight, or none was found that keeps the least speed.
    """
    if kin.min_speed > 0 and any(kin.wind):
        return kin.over_ground(straight_flight(kin.in_the_air()))
    line = kin.end - kin.start
    distance = float(np.linalg.norm(line))
    ends = [v for v in (kin.start_velocity, kin.end_velocity) if v is not None]
    fallback = next((v / np.linalg.norm(v) for v in ends if v.any()), _EAST)
    direction = line / distance if distance else fallback
    if not _leads_aside(kin, direction):
        speed = even_speed(kin, direction, distance)
        if speed is not None:
            flight = kin.follow(speed[:, None] * direction)
            if kin.residuals(flight).get("turn", 0.0) < 1e-9:
                return flight
    return cruise(kin) if kin.min_speed > 0 else _flight_aside(kin)


def _leads_aside(kin: Kinematics, direction: Real) -> bool:
    """Return whether a given end velocity has a part across `direction` (2,)."""
    across = np.array([-direction[1], direction[0]])
    ends = (v for v in (kin.start_velocity, kin.end_velocity) if v is not None)
    return any(abs(v @ across) > _ALONG * kin.max_speed for v in ends)


def even_speed(kin: Kinematics, direction: Real, distance: float) -> Real | None:
    """Return speeds (N + 2,), m/s, along `direction` (2,), as near to one value as possible.

    They cover `distance` metres within the limits of `kin`; None if no speeds do.
    """
    lower, upper = _speed_limits(kin, direction)
    slack = 1e-9 * max(1.0, distance)
    if (lower > upper + 1e-12).any():
        return None
    if not _distance(kin, lower) - slack <= distance <= _distance(kin, upper) + slack:
        return None
    # the distance is a piecewise linear function of the speed, with breaks at the limits
    share = np.full(kin.slots, kin.time_step)
    share[[0, -1]] /= 2
    limits = np.concatenate([lower, upper])
    order = np.argsort(limits)
    speeds = limits[order]
    rise = np.cumsum(np.concatenate([share, -share])[order])
    flown = share @ lower + np.concatenate([[0.0], np.cumsum(rise[:-1] * np.diff(speeds))])
    return np.asarray(np.clip(np.interp(distance, flown, speeds), lower, upper))


def _speed_limits(kin: Kinematics, direction: Real) -> tuple[Real, Real]:
    """Return the least and the greatest speed (N + 2,) that the ends and the limits allow, m/s."""
    n = np.arange(kin.slots, dtype=float)
    rise, fall = (kin.time_step * rate for rate in kin.even_rates)
    least, most = kin.speeds_along(direction)
    lower, upper = np.full(kin.slots, least), np.full(kin.slots, most)
    if kin.start_velocity is not None:
        first = float(kin.start_velocity @ direction)
        steps = n + (0.0 if kin.bound_first_acceleration else np.where(n > 0, np.inf, 0.0))
        upper = np.minimum(upper, first + rise * steps)
        lower = np.maximum(lower, first - fall * steps)
    if kin.end_velocity is not None:
        last, steps = float(kin.end_velocity @ direction), n[::-1]
        upper = np.minimum(upper, last + fall * steps)
        lower = np.maximum(lower, last - rise * steps)
    return lower, upper


def _distance(kin: Kinematics, speed: Real) -> float:
    """Return the distance in metres at the speeds (N + 2,)."""
    return float(kin.time_step * (speed[:-1] + speed[1:]).sum() / 2)


def _flight_aside(kin: Kinematics) -> Trajectory:
    """Return the feasible flight nearest to an even one, for end velocities across the line."""
    share = np.linspace(0, 1, kin.slots)[:, None]
    even = kin.start + share * (kin.end - kin.start)
    ends = (
        np.zeros(2) if velocity is None else velocity
        for velocity in (kin.start_velocity, kin.end_velocity)
    )
    first, last = ends
    flight = nearest_flight(kin, even, kin.follow((1 - share) * first + share * last))
    if flight is None:
        air = f"{kin.max_airspeed:.4g} m/s through the air, " if any(kin.wind) else ""
        raise InfeasibleError(
            "no flight from start to end meets the end velocities within the duration, "
            f"{air}{kin.max_speed:g} m/s and {kin.max_acceleration:g} m/s^2; "
            "give more time or gentler end velocities"
        )
    return flight


def with_stops(
    kin: Kinematics, stops: Sequence[Real], times: Real | None = None
) -> Trajectory | None:
    """Return the flight that stops at `stops`, straight between them; None if the time is short.

    Between stops it is as quick as it can be. It leaves them as near to `times`, s, as the others
    allow; without, it hovers at each for an even part of the rest.
    """
    if not len(stops):
        return straight_flight(kin)
    legs = list[Real]()
    for k, (a, b) in enumerate(pairwise([kin.start, *stops, kin.end])):
        first, last = k == 0, k == len(stops)
        leg = _quickest(
            replace(
                kin,
                start=a,
                end=b,
                start_velocity=kin.start_velocity if first else np.zeros(2),
                end_velocity=kin.end_velocity if last else np.zeros(2),
                bound_first_acceleration=kin.bound_first_acceleration or not first,
            )
        )
        if leg is None:
            return None
        legs.append(leg)
    begins = np.cumsum([0, *(len(leg) - 1 for leg in legs)])
    spare = kin.slots - 1 - int(begins[-1])
    if spare < 0:
        return None
    share = np.arange(1, len(legs)) / len(stops)
    waited = spare * share if times is None else times / kin.time_step - begins[1:-1]
    waited = np.maximum.accumulate(np.clip(np.rint(waited), 0, spare)).astype(int)
    velocities = np.zeros((kin.slots, 2))
    delays = np.array([0, *waited[:-1], spare])
    for begin, leg in zip(begins[:-1] + delays, legs, strict=True):
        velocities[begin : begin + len(leg)] = leg
    return kin.follow(velocities)


def _quickest(kin: Kinematics) -> Real | None:
    """Return the velocities (n, 2) of a straight flight in the fewest slots, or None."""
    line = kin.end - kin.start
    distance = float(np.hypot(*line))
    direction = line / distance if distance else _EAST
    if _leads_aside(kin, direction):
        return None

    def speed_in(slots: int) -> Real | None:
        return even_speed(replace(kin, slots=slots), direction, distance)

    counts = range(2, kin.slots + 1)
    found = bisect_left(counts, True, key=lambda slots: speed_in(slots) is not None)
    speed = speed_in(counts[found]) if found < len(counts) else None
    return None if speed is None else speed[:, None] * direction
