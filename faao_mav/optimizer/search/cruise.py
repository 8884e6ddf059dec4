"""Starts for an aircraft that cannot hover: feasible flights with ||v|| >= v_min throughout.

Where there is more time than the line from w_I to w_F takes, the flight weaves about the line or
flies full circles. Both are built as headings theta(n) at one speed c: the displacement is
c delta_t sum (cos, sin) theta(n), to which a full circle adds nothing. Given end velocities add a
turn and a change of speed at each end.
"""

from collections.abc import Callable, Iterator
from itertools import product

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.kinematics import Kinematics, Trajectory

# Chosen, but for _WIDEST.
_TURN_SHARE = 0.95  # share of a_max that turns use; the rest is for meeting the ends
_WIDEST = 2.404825557695773  # amplitude of a weave of no displacement: the first zero of J_0
_WEAVES = (16, 8, 4, 2, 1)  # numbers of waves that are tried; many stay close to the line
_SPEEDS = (1.1, 1.02, 1.3, 1.0)  # speeds c that are tried, in v_min; above 1 there is room
_TOLERANCE = 1e-9  # violation of a limit, in its SI unit, and length in metres that are zero
_ROUNDS = 40  # bisections of an amplitude, and fixed-point rounds of a line between two turns

Headings = Callable[[int, float], Real]
"""A function of k and a share: k headings (k,), radians, relative to the mean direction, whose
displacement is that share of the distance flown."""


def cruise(kin: Kinematics) -> Trajectory:
    """Return a feasible flight that weaves towards w_F or circles on the way.

    Raises:
        InfeasibleError: none was found, which is no proof that there is none.
    """
    for flight in _attempts(kin, []):
        return flight
    raise InfeasibleError(
        f"no flight from start to end was found that keeps at least {kin.min_speed:g} m/s "
        f"(vehicle.min_speed) for {kin.time_step * kin.slots:g} s within {kin.max_speed:g} m/s, "
        f"{kin.max_acceleration:g} m/s^2 and the end velocities; give a longer or shorter "
        "flight.duration, free end velocities or a lower vehicle.min_speed"
    )


def cruise_by(kin: Kinematics, stations: list[Real]) -> Trajectory | None:
    """Return a feasible flight that circles at each of `stations`, or None if none was found."""
    return next(_attempts(kin, stations), None)


def _attempts(kin: Kinematics, stations: list[Real]) -> Iterator[Trajectory]:
    """Yield the feasible ones of the flights that are tried, in the order of preference."""
    speeds = sorted({min(kin.max_speed, share * kin.min_speed) for share in _SPEEDS}, reverse=True)
    middle = (kin.min_speed + kin.max_speed) / 2
    if stations:
        for c in (min(middle, 3 * kin.min_speed), *speeds):
            yield from _feasible(kin, _circling(kin, stations, c))
        return
    first, last = ((0.0,) if v is None else (0.0, 2 * np.pi, -2 * np.pi) for v in _ends(kin))
    ends = product(first, last)
    for extra in sorted(ends, key=lambda pair: abs(pair[0]) + abs(pair[1])):
        for c in (*speeds, middle):
            for headings in (*(_weave(m) for m in _WEAVES), _circle(1), _circle(-1)):
                yield from _feasible(kin, _between_turns(kin, headings, c, extra))


def _ends(kin: Kinematics) -> tuple[Real | None, Real | None]:
    return kin.start_velocity, kin.end_velocity


def _feasible(kin: Kinematics, v: Real | None) -> Iterator[Trajectory]:
    """Yield the flight with velocities v (n, 2), corrected to meet the ends, if it is feasible."""
    if v is None:
        return
    flight = kin.follow(v)
    if max(kin.residuals(flight).values()) < _TOLERANCE:
        yield flight


def _weave(waves: int) -> Headings:
    """Return headings that swing about the mean direction `waves` times."""

    def headings(count: int, share: float) -> Real:
        phase = np.sin(2 * np.pi * waves * np.arange(count) / (count - 1))
        low, high = 0.0, _WIDEST
        for _ in range(_ROUNDS):
            middle = (low + high) / 2
            low, high = (middle, high) if _mean(middle * phase) > share else (low, middle)
        return np.asarray(high * phase)

    return headings


def _circle(turns: int) -> Headings:
    """Return straight headings with `turns` full circles half way, left if positive."""

    def headings(count: int, share: float) -> Real:
        straight = round((count - 1) * share)
        before = straight // 2
        round_trip = count - 1 - straight
        steps = np.clip(np.arange(count) - before, 0, round_trip)
        return np.asarray(2 * np.pi * turns * steps / max(1, round_trip))

    return headings


def _mean(headings: Real) -> float:
    """Return the displacement along the mean direction as a share of the distance flown."""
    along = np.cos(headings)
    return float((along[1:] + along[:-1]).mean() / 2)


def _turn(kin: Kinematics, v: Real, heading: float, extra: float, c: float) -> Real:
    """Return velocities (k, 2) from v to speed c along `heading`, `extra` radians added."""
    speed, first = float(np.hypot(*v)), float(np.arctan2(v[1], v[0]))
    angle = (heading - first + np.pi) % (2 * np.pi) - np.pi + extra
    limit = _TURN_SHARE * kin.max_acceleration * kin.time_step
    # turning and speeding up share the limit: the sum of their squares stays below its square
    steps = int(np.ceil(np.hypot(abs(angle) * max(speed, c), speed - c) / limit))
    share = np.arange(steps + 1) / max(1, steps)
    size, at = speed + (c - speed) * share, first + angle * share
    return np.asarray(size[:, None] * np.stack([np.cos(at), np.sin(at)], axis=1))


def _displacement(kin: Kinematics, v: Real) -> Real:
    """Return the displacement (2,) at the velocities v (k, 2), m."""
    return np.asarray(kin.time_step * (v[1:] + v[:-1]).sum(axis=0) / 2)


def _between_turns(
    kin: Kinematics, headings: Headings, c: float, extra: tuple[float, float]
) -> Real | None:
    """Return velocities (n, 2): a turn from v(0), `headings` at speed c, a turn to v(N+1).

    `extra` are the radians, 0 or a full circle, by which the turns are longer than they must be.
    None where there is no time for the turns or c exceeds v_max.
    """
    goal = kin.end - kin.start
    line, fallback = goal, next((v for v in _ends(kin) if v is not None), np.array([1.0, 0.0]))
    ends: list[Real] = []
    for _ in range(_ROUNDS):  # the turns depend on the line between them, and the line on them
        towards = line if np.hypot(*line) > _TOLERANCE else fallback
        heading = float(np.arctan2(towards[1], towards[0]))
        on = c * np.array([np.cos(heading), np.sin(heading)])
        first, last = (
            on[None] if v is None else _turn(kin, v if k == 0 else -v, at, extra[k], c)
            for k, (v, at) in enumerate(zip(_ends(kin), (heading, heading + np.pi), strict=True))
        )
        ends = [first, -last[::-1] if kin.end_velocity is not None else last]
        line = goal - _displacement(kin, ends[0]) - _displacement(kin, ends[1])
        count = kin.slots - len(ends[0]) - len(ends[1]) + 2
        if count < 3:
            return None
        whole = kin.time_step * (count - 1)
        c = max(c, float(np.hypot(*line)) / whole)
        if c > kin.max_speed:
            return None
    share = float(np.hypot(*line)) / (c * whole)
    theta = headings(count, share)
    # a circle of whole steps misses the share by a little, which the speed makes up for
    reached = _mean(theta)
    if share > 0 and reached > 0:
        c = float(np.clip(c * share / reached, kin.min_speed, kin.max_speed))
    theta = theta + heading
    inner = c * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    if kin.start_velocity is not None:
        inner[0] = ends[0][-1]
    if kin.end_velocity is not None:
        inner[-1] = ends[1][0]
    return np.vstack([ends[0][:-1], inner, ends[1][1:]])


def _circling(kin: Kinematics, stations: list[Real], c: float) -> Real | None:
    """Return velocities (n, 2) straight to each of `stations`, with circles there, and to w_F.

    The time that is left is shared evenly among the stations. None where it is too short.
    """
    points = [kin.start, *stations, kin.end]
    lines = np.diff(np.array(points), axis=0)
    lengths = np.hypot(*lines.T)
    if lengths.min() < _TOLERANCE:
        return None
    headings = np.arctan2(lines[:, 1], lines[:, 0])
    steps = np.round(lengths / (c * kin.time_step)).astype(int)
    first, last = kin.start_velocity, kin.end_velocity
    on = np.stack([np.cos(headings), np.sin(headings)], axis=1)
    lead = on[:0] if first is None else _turn(kin, first, float(headings[0]), 0.0, c)[:-1]
    tail = on[:0]
    if last is not None:
        tail = -_turn(kin, -last, float(headings[-1]) + np.pi, 0.0, c)[:-1][::-1]
    spare = kin.slots - 1 - int(steps.sum()) - len(lead) - len(tail)
    each = np.full(len(stations), max(0, spare) // len(stations))
    each[0] += max(0, spare) % len(stations)
    fastest = _TURN_SHARE * kin.max_acceleration * kin.time_step / c  # radians per step
    theta = [np.full(steps[0] + 1, headings[0])]
    for k, count in enumerate(each):
        corner = (headings[k + 1] - headings[k] + np.pi) % (2 * np.pi) - np.pi
        most = count * fastest - abs(corner)
        if most < 0:
            return None
        side = 1.0 if corner >= 0 else -1.0
        turn = corner + side * 2 * np.pi * np.floor(most / (2 * np.pi))
        theta.append(headings[k] + turn * np.arange(1, count + 1) / count)
        theta.append(np.full(steps[k + 1], headings[k + 1]))
    at = np.concatenate(theta)
    v = np.vstack([lead, c * np.stack([np.cos(at), np.sin(at)], axis=1), tail])
    return v if len(v) == kin.slots else None
