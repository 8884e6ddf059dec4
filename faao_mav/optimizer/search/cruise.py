"""Starts for an aircraft that cannot hover: feasible flights with ||v|| >= v_min throughout.

Of curves at several speeds whose turn rate is constant piece by piece (circles, eights, Dubins
paths and between) the first that keeps every limit is taken; where none does, the interior-point
method finds the flight nearest to one of them that does. Flights by way of stations circle there
for what time is left.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.interior.constraint import every_excess
from faao_mav.optimizer.interior.maximize import constraints_of
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.search.track import nearest_flight

_TURN_SHARE = 0.95
"""Share of the largest acceleration that turns use; the rest is for meeting the ends. Chosen."""

_PIECES = 8
"""Pieces of constant turn rate: chosen. A Dubins path has three."""

_PIECE_SHARE = 0.98
"""The same of curves of such pieces; the rest is for rounding to samples. Chosen."""

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


def cruise(kin: Kinematics) -> Trajectory:
    """Return a feasible flight whose turn rate is constant piece by piece, or one near to that.

    Raises:
        InfeasibleError: none was found, which is no proof that there is none.
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
    """Return a feasible flight that circles at each of `stations`, or None if none was found."""
    middle = (kin.min_speed + kin.max_speed) / 2
    curves = (_circling(kin, stations, c) for c in (middle, *_speeds(kin)))
    return _first_flight(kin, (v for v in curves if v is not None))


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
    most = np.full(_PIECES, _PIECE_SHARE * kin.turning(speed.max()) / speed.max())
    known = 0.0 if start is None else float(np.arctan2(start[1], start[0]))
    if start is None:
        turned, most = np.column_stack([turned, np.ones(kin.slots)]), np.append(most, 2 * np.pi)
    step = kin.time_step * speed
    step[[0, -1]] /= 2  # (11) is the trapezoidal rule
    reach = c * width  # metres for one radian of the last heading

    def missed(x: Real) -> Real:
        along = _direction(known + turned @ x)
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


def _direction(theta: Real) -> Real:
    """Return the unit vectors (..., 2) of headings `theta` (...)."""
    return np.stack([np.cos(theta), np.sin(theta)], axis=-1)


def _velocities(kin: Kinematics, speed: Real, theta: Real) -> Real:
    """Return the velocities (n, 2) of speeds and headings (n,), those of given ends exact."""
    v = speed[:, None] * _direction(theta)
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
