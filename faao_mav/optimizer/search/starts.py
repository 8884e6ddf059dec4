"""The feasible flights that the search starts from: straight, and by way of the stations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.search.cruise import cruise, cruise_by

BY_STATIONS = ("straight", "bs", "user", "bs-user", "user-bs")
"""What `global` stands for: paths found over the map gained nothing beside these (44 random plans,
fences and samples)."""

_BISECTIONS = 12
"""Bisections of the share of the way to the stations: it is found to 1 / 4096. Chosen."""

_LEAST_SHARE = 0.02
"""Share of the way to a station below which a start would be all but the straight one. Chosen."""

_EAST = np.array([1.0, 0.0])  # the direction of a line of no length
_ALONG = 1e-12  # velocity across a line, in shares of v_max, that counts as none: rounding errors


def by_name(names: Sequence[str]) -> Sequence[str]:
    """Return the flights that `names` of the plan's `optimizer.starts` ask for."""
    return BY_STATIONS if "global" in names else names


def starts(
    kin: Kinematics, names: Sequence[str], stations: Mapping[str, Real]
) -> dict[str, Trajectory]:
    """Return the flights named in the plan's `optimizer.starts`.

    A name is `straight` or the stations in the order of the visit, as in `bs-user`. A flight by way
    of stations goes as far towards them as the time allows, and hovers there for what time is left;
    with a least speed it goes all the way and circles there. Flights that do not exist (no time at
    all, or end velocities across the way) are left out. If none is left, the result is the straight
    flight.

    Args:
        kin: the feasible set.
        names: the flights asked for.
        stations: the positions (2,) of the stations by name, m.

    Raises:
        InfeasibleError: there is no straight flight, and it was asked for or is the only one.

    >>> from faao_mav.optimizer.kinematics import Kinematics
    >>> kin = Kinematics(np.zeros(2), np.array([60.0, 0.0]), 41, 0.5, 8.0, 2.0, None, None, True)
    >>> flights = starts(kin, ["straight", "user"], {"user": np.array([30.0, 20.0])})
    >>> [round(float(flight.w[:, 1].max()), 3) for flight in flights.values()]
    [0.0, 20.0]
    """
    found = {}
    for name in names:
        if name == "straight":
            found[name] = straight_flight(kin)
            continue
        stops = [stations[key] for key in name.split("-")]
        flight = _circling_by(kin, stops) if kin.min_speed > 0 else _by_way_of(kin, stops)
        if flight is not None:
            found[name] = flight
    return found or {"straight": straight_flight(kin)}


def straight_flight(kin: Kinematics) -> Trajectory:
    """Return a feasible flight along the line from w_I to w_F, at the most even speed.

    Where end velocities do not lie on that line, it is the flight of least sum ||a||²; where the
    line is too short for the least speed, one with detours (see `cruise`).

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
    return cruise(kin) if kin.min_speed > 0 else _gentlest_flight(kin)


def _circling_by(kin: Kinematics, stations: list[Real]) -> Trajectory | None:
    """Return the flight that circles at `stations`, with the wind: it is over them at half time."""
    drift = kin.time_step * (kin.slots - 1) / 2 * np.array(kin.wind)
    flight = cruise_by(kin.in_the_air(), [station - drift for station in stations])
    return None if flight is None else kin.over_ground(flight)


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


def fewest_slots(kin: Kinematics, direction: Real, distance: float) -> int | None:
    """Return the least number of slots in which a straight flight covers `distance` metres.

    None if `kin` has fewer. The quickest flight speeds up as long as it can and then slows down:
    its distance in 2, 3, ... slots follows from the cumulative sums of both.
    """
    after = np.arange(kin.slots)
    slots = after[1:] + 1
    gain = kin.max_acceleration * kin.time_step
    most = kin.speeds_along(direction)[1]
    rising, falling = np.full((2, kin.slots), most)
    split, possible = np.zeros_like(slots), np.ones(slots.shape, dtype=bool)
    if kin.end_velocity is not None:
        last = float(kin.end_velocity @ direction)
        falling = np.minimum(most, last + gain * after)
    if kin.start_velocity is not None:
        first = float(kin.start_velocity @ direction)
        if kin.bound_first_acceleration:
            rising = np.minimum(most, first + gain * after)
        rising[0] = first
        if kin.end_velocity is None:
            split = slots
        elif kin.bound_first_acceleration:
            split = np.floor(((slots - 1) + (last - first) / gain) / 2).astype(int) + 1
        else:
            split = (first <= falling[slots - 1]).astype(int)
        if kin.end_velocity is not None:
            possible = abs(first - last) <= gain * (slots - 1) + 1e-12
    split = np.clip(split, 0, slots)
    up, down = (np.concatenate([[0.0], np.cumsum(speed)]) for speed in (rising, falling))
    ends = np.minimum(rising[0], falling[slots - 1]) + np.minimum(rising[slots - 1], falling[0])
    covered = kin.time_step * (up[split] + down[slots - split] - ends / 2)
    enough = np.flatnonzero(possible & (covered >= distance))
    return int(slots[enough[0]]) if enough.size else None


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


def _gentlest_flight(kin: Kinematics) -> Trajectory:
    """Return the feasible flight of least sum ||a||², a convex problem for Clarabel."""
    import cvxpy as cp

    from faao_mav.optimizer.scaled import flight_variables, solve

    flight = flight_variables(kin)
    problem = cp.Problem(cp.Minimize(cp.sum_squares(flight.a)), flight.constraints)
    if solve(problem) == cp.INFEASIBLE:
        air = f"{kin.max_airspeed:.4g} m/s through the air, " if any(kin.wind) else ""
        raise InfeasibleError(
            "no flight from start to end meets the end velocities within the duration, "
            f"{air}{kin.max_speed:g} m/s and {kin.max_acceleration:g} m/s^2; "
            "give more time or gentler end velocities"
        )
    return flight.trajectory()


def _by_way_of(kin: Kinematics, stations: list[Real]) -> Trajectory | None:
    """Return the flight that goes the largest possible share of the way to `stations`."""
    anchors = [_nearest_on_line(kin.start, kin.end, p) for p in stations]

    def attempt(share: float) -> list[_StraightPart] | None:
        stops = [a + share * (p - a) for a, p in zip(anchors, stations, strict=True)]
        return _parts(kin, stops)

    best = attempt(1.0)
    if best is not None:
        return _joined(kin, best)
    if attempt(_LEAST_SHARE) is None:
        return None
    low, high = 0.0, 1.0
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        parts = attempt(middle)
        if parts is None:
            high = middle
        else:
            low, best = middle, parts
    return None if best is None else _joined(kin, best)


def with_stops(kin: Kinematics, stops: list[Real]) -> Trajectory | None:
    """Return the flight that stops at `stops`, straight between them; None if the time is short."""
    if not stops:
        return straight_flight(kin)
    parts = _parts(kin, stops)
    return None if parts is None else _joined(kin, parts)


def _nearest_on_line(a: Real, b: Real, p: Real) -> Real:
    """Return the point nearest to p between a and b, (2,)."""
    line = b - a
    square = float(line @ line)
    share = min(1.0, max(0.0, float((p - a) @ line) / square)) if square else 0.0
    return np.asarray(a + share * line)


@dataclass(frozen=True, slots=True)
class _StraightPart:
    """A straight flight of `distance` metres along `direction`, in the fewest slots it takes."""

    kin: Kinematics
    direction: Real
    distance: float


def _parts(kin: Kinematics, stops: list[Real]) -> list[_StraightPart] | None:
    """Return the flights from stop to stop, each as fast as allowed; None if the time is short."""
    points = [kin.start, *stops, kin.end]
    parts, spare = [], kin.slots - 1
    for k in range(len(points) - 1):
        first, last = k == 0, k == len(points) - 2
        own = replace(
            kin,
            start=points[k],
            end=points[k + 1],
            start_velocity=kin.start_velocity if first else np.zeros(2),
            end_velocity=kin.end_velocity if last else np.zeros(2),
            bound_first_acceleration=kin.bound_first_acceleration or not first,
        )
        line = own.end - own.start
        distance = float(np.hypot(*line))
        direction = line / distance if distance else _EAST
        slots = fewest_slots(own, direction, distance)
        if _leads_aside(own, direction) or slots is None or slots - 1 > spare:
            return None
        spare -= slots - 1
        parts.append(_StraightPart(replace(own, slots=slots), direction, distance))
    return parts


def _joined(kin: Kinematics, parts: list[_StraightPart]) -> Trajectory | None:
    """Return the flight along `parts`, with equal hovers between them for what time is left."""
    velocities = []
    for part in parts:
        speed = even_speed(part.kin, part.direction, part.distance)
        if speed is None:
            return None
        velocities.append(speed[:, None] * part.direction)
    stops = len(parts) - 1
    spare = kin.slots - 1 - sum(len(v) - 1 for v in velocities)
    for k in range(stops):
        hover = spare // stops + (k < spare % stops)
        velocities[k + 1] = np.vstack([np.zeros((hover, 2)), velocities[k + 1][1:]])
    return kin.follow(np.vstack(velocities))
