"""Feasible flights: straight at the most even speed, with stops between, or that never hover.

For an aircraft that cannot hover, of curves at several speeds whose turn rate is constant piece by
piece (circles, eights, Dubins paths and between) the first that keeps every limit is taken; where
none does, the interior-point method finds the flight nearest to one of them that does. Flights by
way of stations circle there for what time is left.
"""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.interior.constraint import every_excess
from faao_mav.optimizer.interior.maximize import constraints_of, nearest_flight
from faao_mav.optimizer.kinematics import Kinematics, Trajectory

_TURN_SHARE = 0.95
"""Share of the largest acceleration that turns use; the rest is for meeting the ends, and for
rounding to samples. Chosen."""

_PIECES = 8
"""Pieces of constant turn rate: chosen. A Dubins path has three."""

_TRIES = 8
"""Random turn rates that are begun with at each speed. Chosen: of six random plans that nothing
else found a flight for, they find one for the two that IPOPT has one for."""

_MOST_EVALUATIONS = 60
"""Evaluations of one least-squares problem; chosen."""

_SPEEDS = (1.3, 1.1, 1.02)
"""Speeds c that are tried, in v_min; above 1 there is room. Chosen."""

_TOLERANCE = 1e-9
"""Violation of a limit, in its SI unit, and length in metres that count as none: rounding."""

_REPAIRS = 12
"""Curves at most that are brought within the limits, the least violation first. Chosen."""

_DRAWN_IN = 0.1
"""Share by which the path of a curve that breaks limits is drawn to its middle: chosen. A path that
is the curve itself has no gradient there."""


def straight_flight(kin: Kinematics) -> Trajectory:
    """Return a feasible flight along the line from w_I to w_F, at the most even speed.

    Where end velocities do not lie on that line, it is the nearest flight to it; where the line is
    too short for the least speed, one with detours (see `cruise`). Raises `InfeasibleError` where
    there is no feasible flight, or none was found that keeps the least speed.
    """
    if kin.min_speed > 0 and any(kin.wind):
        return kin.over_ground(straight_flight(kin.in_the_air()))
    velocities = _along_line(kin)
    if velocities is not None:
        flight = kin.follow(velocities)
        if kin.residuals(flight).get("turn", 0.0) < _TOLERANCE:
            return flight
    return cruise(kin) if kin.min_speed > 0 else _flight_aside(kin)


def _along_line(kin: Kinematics) -> Real | None:
    """Return the most even velocities (N + 2, 2) along the line, or None if it cannot be flown."""
    line, distance = kin.end - kin.start, float(np.hypot(*(kin.end - kin.start)))
    ends = [v for v in (kin.start_velocity, kin.end_velocity) if v is not None]
    lines = [line, *ends, np.array([1.0, 0.0])]
    direction = next(each / np.hypot(*each) for each in lines if each.any())
    across = np.array([-direction[1], direction[0]])
    if any(abs(v @ across) > _TOLERANCE for v in ends):
        return None
    speed = even_speed(kin, direction, distance)
    return None if speed is None else speed[:, None] * direction


def even_speed(kin: Kinematics, direction: Real, distance: float) -> Real | None:
    """Return speeds (N + 2,), m/s, along `direction` (2,), as near to one value as possible.

    They cover `distance` metres within the limits of `kin`; None if no speeds do.
    """
    n = np.arange(kin.slots, dtype=float)
    rise, fall = (kin.time_step * rate for rate in kin.even_rates)
    lower, upper = np.repeat([kin.speeds_along(direction)], kin.slots, axis=0).T
    if kin.start_velocity is not None:
        first = float(kin.start_velocity @ direction)
        steps = n if kin.bound_first_acceleration else np.where(n > 0, np.inf, 0.0)
        upper = np.minimum(upper, first + rise * steps)
        lower = np.maximum(lower, first - fall * steps)
    if kin.end_velocity is not None:
        last, steps = float(kin.end_velocity @ direction), n[::-1]
        upper = np.minimum(upper, last + fall * steps)
        lower = np.maximum(lower, last - rise * steps)
    slack = 1e-9 * max(1.0, distance)
    if (lower > upper + 1e-12).any():
        return None
    share = np.full(kin.slots, kin.time_step)
    share[[0, -1]] /= 2
    if not share @ lower - slack <= distance <= share @ upper + slack:
        return None
    # the distance is a piecewise linear function of the speed, with breaks at the limits
    limits = np.concatenate([lower, upper])
    order = np.argsort(limits)
    speeds = limits[order]
    gain = np.cumsum(np.concatenate([share, -share])[order])
    flown = share @ lower + np.concatenate([[0.0], np.cumsum(gain[:-1] * np.diff(speeds))])
    return np.asarray(np.clip(np.interp(distance, flown, speeds), lower, upper))


def _flight_aside(kin: Kinematics) -> Trajectory:
    """Return the feasible flight nearest to an even one, for end velocities across the line."""
    share = np.linspace(0, 1, kin.slots)[:, None]
    first, last = (
        np.zeros(2) if velocity is None else velocity
        for velocity in (kin.start_velocity, kin.end_velocity)
    )
    even = kin.start + share * (kin.end - kin.start)
    flight = nearest_flight(kin, even, kin.follow((1 - share) * first + share * last))
    if flight is None:
        air = f"{kin.max_airspeed:.4g} m/s through the air, " if any(kin.wind) else ""
        raise InfeasibleError(
            "no flight from start to end meets the end velocities within the duration, "
            f"{air}{kin.max_speed:g} m/s and {kin.max_acceleration:g} m/s^2; "
            "give more time or gentler end velocities"
        )
    return flight


def with_stops(kin: Kinematics, stops: Sequence[Real]) -> Trajectory | None:
    """Return the flight that stops at `stops`, straight between them; None if the time is short.

    Between stops it is as quick as it can be; it hovers at each for an even part of the rest.
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
    delays = np.rint(spare * np.arange(len(legs)) / len(stops)).astype(int)
    velocities = np.zeros((kin.slots, 2))
    for begin, leg in zip(begins[:-1] + delays, legs, strict=True):
        velocities[begin : begin + len(leg)] = leg
    return kin.follow(velocities)


def _quickest(kin: Kinematics) -> Real | None:
    """Return the velocities (n, 2) of a straight flight in the fewest slots, or None."""

    def within(slots: int) -> Real | None:
        return _along_line(replace(kin, slots=slots))

    counts = range(2, kin.slots + 1)
    fewest = bisect_left(counts, True, key=lambda slots: within(slots) is not None)
    return within(counts[fewest]) if fewest < len(counts) else None


def cruise(kin: Kinematics) -> Trajectory:
    """Return a feasible flight whose turn rate is constant piece by piece, or one near to that.

    Raises `InfeasibleError` where none was found, which is no proof that there is none.
    """
    flight = _first_flight(kin, (v for c in _speeds(kin) for v in turning_curves(kin, c)))
    if flight is None:
        turns = f", turns of {np.degrees(kin.most_turn):.3g} degrees a second (its guidance's)"
        raise InfeasibleError(
            f"no flight from start to end was found that keeps at least {kin.min_speed:g} m/s "
            f"(vehicle.min_speed) for {kin.time_step * kin.slots:g} s within {kin.max_speed:g} "
            f"m/s, {kin.max_acceleration:.3g} m/s^2{turns if kin.turn_binds else ''} and the end "
            "velocities; give a longer or shorter flight.duration, free end velocities or a lower "
            "vehicle.min_speed"
        )
    return flight


def cruise_by(kin: Kinematics, stations: Sequence[Real]) -> Trajectory | None:
    """Return a feasible flight that circles at each of `stations`, or None if none was found.

    In wind it drifts: it is over them at half the time.
    """
    calm = kin.in_the_air()
    drift = kin.time_step * (kin.slots - 1) / 2 * np.array(kin.wind)
    places = [station - drift for station in stations]
    middle = (calm.min_speed + calm.max_speed) / 2
    curves = (_circling(calm, places, c) for c in (middle, *_speeds(calm)))
    flight = _first_flight(calm, (v for v in curves if v is not None))
    return None if flight is None else kin.over_ground(flight)


def _first_flight(kin: Kinematics, curves: Iterator[Real]) -> Trajectory | None:
    """Return the first feasible flight at velocities (n, 2) of `curves`, else one near to some."""
    near: list[tuple[float, int, Trajectory]] = []
    for v in curves:
        flight = kin.follow(v)
        if max(kin.residuals(flight).values()) < _TOLERANCE:
            return flight
        near.append((every_excess(kin, constraints_of(kin), flight), len(near), flight))
    for _, _, flight in sorted(near)[:_REPAIRS]:
        drawn_in = (1 - _DRAWN_IN) * flight.w + _DRAWN_IN * flight.w.mean(axis=0)
        repaired = nearest_flight(kin, drawn_in, flight, first=True)
        if repaired is not None:
            return repaired
    return None


def _speeds(kin: Kinematics) -> list[float]:
    """Return the speeds c that are tried, m/s."""
    ends = [float(np.hypot(*v)) for v in (kin.start_velocity, kin.end_velocity) if v is not None]
    middle = (kin.min_speed + kin.max_speed) / 2
    tried = [*(share * kin.min_speed for share in _SPEEDS), middle, *ends, kin.max_speed]
    return list(dict.fromkeys(c for c in tried if c <= kin.max_speed))


def turning_curves(kin: Kinematics, c: float) -> Iterator[Real]:
    """Yield velocities (N + 2, 2), m/s, of curves at speed c that end near w_F, in calm air.

    The heading is theta(t) = theta_0 + integral of u_k, with turn rates |u_k| <= a / c in pieces of
    equal time, a the largest acceleration at c; theta_0 is free where the start velocity is. The
    rates that lead nearest to w_F, and to the end velocity's heading, are found by bounded least
    squares from several random ones.

    >>> kin = Kinematics(np.zeros(2), np.array([0.0, 90.0]), 61, 1.0, 14.0, 2.5, None, None, True,
    ...                  min_speed=12.0)
    >>> flights = [kin.follow(v) for v in turning_curves(kin, 13.0)]
    >>> bool(min(max(kin.residuals(flight).values()) for flight in flights) < 1e-9)
    True
    """
    from scipy.optimize import least_squares  # slow to load, and seldom needed

    time = kin.time_step * np.arange(kin.slots, dtype=float)
    speed, start, end = _near_ends(kin, c, time), kin.start_velocity, kin.end_velocity
    width = time[-1] / _PIECES
    turned = np.clip(time[:, None] - width * np.arange(_PIECES), 0.0, width)  # s in each piece
    most = np.full(_PIECES, _TURN_SHARE * kin.turning(speed.max()) / speed.max())
    known = 0.0 if start is None else float(np.arctan2(start[1], start[0]))
    if start is None:
        turned, most = np.column_stack([turned, np.ones(kin.slots)]), np.append(most, 2 * np.pi)
    step = kin.time_step * speed
    step[[0, -1]] /= 2  # (11) is the trapezoidal rule
    reach = c * width  # metres for one radian of the last heading

    def missed(x: Real) -> Real:
        theta = known + turned @ x
        along = np.stack([np.cos(theta), np.sin(theta)], axis=1)
        away = step @ along - (kin.end - kin.start)
        return away if end is None else np.append(away, reach * (along[-1] - end / np.hypot(*end)))

    random = np.random.default_rng(0)
    for _ in range(_TRIES):
        begun = random.uniform(-most, most) / 2
        found = least_squares(missed, begun, bounds=(-most, most), max_nfev=_MOST_EVALUATIONS)
        yield _velocities(kin, speed, known + turned @ found.x)


def _near_ends(kin: Kinematics, c: float, time: Real) -> Real:
    """Return speeds (N + 2,), m/s: as near to c as changes from and to the given ends allow."""
    speed, (rise, fall) = np.full(kin.slots, c), kin.even_rates
    for velocity, since, gain, loss in (
        (kin.start_velocity, time, rise, fall),
        (kin.end_velocity, time[::-1], fall, rise),
    ):
        if velocity is not None:
            size = float(np.hypot(*velocity))
            most = kin.turning(min(size, c))
            low, high = size - min(loss, most) * since, size + min(gain, most) * since
            speed = np.clip(speed, low, high)
    return speed


def _velocities(kin: Kinematics, speed: Real, theta: Real) -> Real:
    """Return the velocities (n, 2) of speeds and headings (n,), those of given ends exact."""
    v: Real = speed[:, None] * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    for velocity, at in ((kin.start_velocity, 0), (kin.end_velocity, -1)):
        if velocity is not None:
            v[at] = velocity
    return v


def _turned_to_ends(kin: Kinematics, theta: Real, c: float) -> Real:
    """Return velocities (n, 2) at speed c along headings `theta` (n,), turned to the given ends."""
    time = kin.time_step * np.arange(kin.slots)
    speed, theta = np.full(kin.slots, c), theta.copy()
    ends = (kin.start_velocity, 0, time), (kin.end_velocity, -1, time[::-1])
    for v, at, since in ends:
        if v is None:
            continue
        size = float(np.hypot(*v))
        angle = (float(np.arctan2(v[1], v[0])) - theta[at] + np.pi) % (2 * np.pi) - np.pi
        # turning and changing speed share the limit: the sum of their squares stays below its own
        change = np.hypot(angle * max(size, c), size - c) / kin.turning(min(size, c))
        rising = (c > size) == (at == 0)
        change = max(change, abs(size - c) / kin.even_rates[0 if rising else 1])
        left = np.clip(1 - since * _TURN_SHARE / max(change, _TOLERANCE), 0, 1)
        theta += angle * left
        speed += (size - c) * left
    return _velocities(kin, speed, theta)


def _circling(kin: Kinematics, stations: Sequence[Real], c: float) -> Real | None:
    """Return velocities (n, 2) straight to each of `stations`, with circles there, and to w_F.

    The time that is left is shared evenly among the stations. None where it is too short.
    """
    lines = np.diff(np.array([kin.start, *stations, kin.end]), axis=0)
    lengths = np.hypot(*lines.T)
    headings = np.arctan2(lines[:, 1], lines[:, 0])
    steps = np.round(lengths / (c * kin.time_step)).astype(int)
    spare = kin.slots - 1 - int(steps.sum())
    if lengths.min() < _TOLERANCE or spare < 0:
        return None
    fastest = _TURN_SHARE * kin.turning(c) * kin.time_step / c  # radians per step
    theta = [np.full(steps[0] + 1, headings[0])]
    for k, corner in enumerate((np.diff(headings) + np.pi) % (2 * np.pi) - np.pi):
        count = spare // len(stations) + (k < spare % len(stations))
        most = count * fastest - abs(corner)
        if most < 0:
            return None
        side = 1.0 if corner >= 0 else -1.0
        turn = corner + side * 2 * np.pi * np.floor(most / (2 * np.pi))
        theta.append(headings[k] + turn * np.arange(1, count + 1) / max(1, count))
        theta.append(np.full(steps[k + 1], headings[k + 1]))
    return _turned_to_ends(kin, np.concatenate(theta), c)
