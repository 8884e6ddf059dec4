"""Curves whose turn rate is constant piece by piece: circles, eights, Dubins paths and between.

The curve has one speed c but near given end velocities. Its heading is theta(t) = theta_0 +
integral of u_k, with turn rates |u_k| <= a / c in pieces of equal time, a the largest acceleration
at c; theta_0 is free where the start velocity is. The rates that lead nearest to w_F, and to the
end velocity's heading, are found by bounded least squares from several random ones.
"""

from collections.abc import Iterator

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.kinematics import Kinematics

_PIECES = 8
"""Pieces of constant turn rate: chosen. A Dubins path has three."""

_TRIES = 8
"""Random turn rates that are begun with at each speed. Chosen: of six random plans that nothing
else found a flight for, they find one for the two that IPOPT has one for."""

_TURN_SHARE = 0.98
"""Share of the largest acceleration that turns use; the rest is for rounding to samples. Chosen."""

_MOST_EVALUATIONS = 60
"""Evaluations of one least-squares problem; chosen."""


def turning_curves(kin: Kinematics, c: float) -> Iterator[Real]:
    """Yield velocities (N + 2, 2), m/s, of curves at speed c that end near w_F, in calm air.

    >>> kin = Kinematics(np.zeros(2), np.array([0.0, 90.0]), 61, 1.0, 14.0, 2.5, None, None, True,
    ...                  min_speed=12.0)
    >>> flights = [kin.follow(v) for v in turning_curves(kin, 13.0)]
    >>> bool(min(max(kin.residuals(flight).values()) for flight in flights) < 1e-9)
    True
    """
    from scipy.optimize import least_squares  # slow to load, and seldom needed

    time = kin.time_step * np.arange(kin.slots, dtype=float)
    speed, goal = _speeds(kin, c, time), kin.end - kin.start
    width = time[-1] / _PIECES
    turned = np.clip(time[:, None] - width * np.arange(_PIECES), 0.0, width)  # s in each piece
    start, end = kin.start_velocity, kin.end_velocity
    known = 0.0 if start is None else _heading(start)
    if start is None:
        turned = np.column_stack([turned, np.ones(kin.slots)])
    share = np.full(kin.slots, kin.time_step)
    share[[0, -1]] /= 2  # (11) is the trapezoidal rule
    reach = c * time[-1] / _PIECES  # metres for one radian of the last heading

    def heading(x: Real) -> Real:
        return np.asarray(known + turned @ x)

    def missed(x: Real) -> Real:
        theta = heading(x)
        away = (share * speed) @ np.stack([np.cos(theta), np.sin(theta)], axis=1) - goal
        if end is None:
            return np.asarray(away)
        return np.append(away, reach * (_direction(theta[-1]) - end / np.hypot(*end)))

    def derivative(x: Real) -> Real:
        theta = heading(x)
        east, north = -share * speed * np.sin(theta), share * speed * np.cos(theta)
        rows = np.stack([east, north]) @ turned
        if end is None:
            return np.asarray(rows)
        across = _direction(theta[-1] + np.pi / 2)
        return np.vstack([rows, reach * across[:, None] * turned[-1]])

    most = np.full(turned.shape[1], _TURN_SHARE * kin.turning(speed.max()) / speed.max())
    if start is None:
        most[-1] = 2 * np.pi
    random = np.random.default_rng(0)
    for _ in range(_TRIES):
        begun = random.uniform(-most, most) / 2
        found = least_squares(
            missed, begun, derivative, bounds=(-most, most), max_nfev=_MOST_EVALUATIONS
        )
        theta = heading(found.x)
        v = speed[:, None] * np.stack([np.cos(theta), np.sin(theta)], axis=1)
        for velocity, at in ((start, 0), (end, -1)):
            if velocity is not None:
                v[at] = velocity
        yield v


def _speeds(kin: Kinematics, c: float, time: Real) -> Real:
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


def _heading(velocity: Real) -> float:
    return float(np.arctan2(velocity[1], velocity[0]))


def _direction(theta: float) -> Real:
    return np.array([np.cos(theta), np.sin(theta)])
