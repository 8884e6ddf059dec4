"""The law of a link's path gain, fitted to what was measured in flight.

The law is `gain_db` = level - 10 n log10 d + c_1 s + c_2 s² + ..., with d the distance to the
station's antenna, m, and s = H/d the sine of the elevation at which it sees the UAV. Antennas'
patterns and the ground's reflection are in the terms of s; what no law of place can say, shadowing,
is the spread that is left.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.errors import InputError
from faao_mav.radio.gain import PathGain
from faao_mav.vector import lengths

_TERMS = 3
"""Terms of the elevation that a law has at most: of flights at five heights more gain nothing."""

SPREAD_OF_NO_LAW = 10.0
"""The spread, dB, beyond which no law of place is said to hold: twice that of open country."""

_ROBUST, _TURNS = 2.5, 8
"""Residuals beyond so many of their spreads count by their size, not its square (Huber); how often
the least squares are weighted anew."""

_EXACT, _DEPENDENT = 1e-9, 1e-12
"""The least spread, dB, and the least share of the greatest eigenvalue that is told from none."""

_TURN, _LEAST, _MOST_LEGS = math.radians(45.0), 10, 100
"""A leg ends where its course has turned by so much, after so many means, or after so many as make
so many legs. Chosen: each leg is left out once."""

_PACE = 1.0
"""Metres between two means below which they are a hover's, which has no course. Chosen."""

APART = 10.0
"""Metres between heights that are left out one by one. Chosen: twice what a copter holds."""

_SWING, _STEEPEST = 40.0, 10.0
"""dB by which the terms of the elevation may differ between the horizon and the zenith (chosen:
deeper nulls of antennas are no polynomial's, and beyond what was flown one may do anything), and
the greatest exponent, the least being 0: what a plan takes."""

PAYS = 0.002
"""The share of the error that more parameters must save. Chosen: less is chance."""

_LAG, _FAR, _LONGEST, _MOST_PAIRED = 10.0, 300.0, 0.25, 700
"""Residuals at two places are compared by steps of so many m of their distance, up to so far, and
the longest correlation is that share of the farthest: a longer one is not told from the level. So
many means are compared at most, for time. Chosen."""


@dataclass(frozen=True, slots=True)
class Samples:
    """What was measured in a flight: `t` (k,), s, the UAV's `place` (k, 3), m, and `level` (k,).

    Places are east, north and up of the station's antenna. The level is the gain, dB, or the gain
    within a constant; of a table, its `unit` is `dbm` of received power or `db` of signal to noise,
    and `left_out` are the rows that tell no level. `source` names the log.

    >>> t = np.arange(0.0, 60.0)
    >>> place = np.stack([10.0 * t, 0.0 * t, 50.0 + 0.0 * t], axis=1)
    >>> flight = Samples(t, place, -40.0 - 20.0 * np.log10(np.linalg.norm(place, axis=1)))
    >>> len(flight.means(2.0).t)
    30
    """

    t: Real
    place: Real
    level: Real
    source: str = ""
    unit: str = "db"
    left_out: int = 0

    def means(self, seconds: float) -> "Samples":
        """Return means over `seconds` of time, of the power and of the place, in flight.

        That is against fast fading. In flight is underway, or above half the median height; what is
        not finite is left out. Where a clock begins anew, as in the next flight, so does a mean;
        rows of which more than 1 % step back in time are put in its order.
        """
        rows = np.column_stack([self.t, self.place, self.level])
        rows = rows[np.isfinite(rows).all(axis=1) & (self.place[:, 2] > 0.0)]
        if np.sum(np.diff(rows[:, 0]) < 0) > 0.01 * len(rows):
            rows = rows[np.argsort(rows[:, 0], kind="stable")]
        rows[:, 4] = 10.0 ** (rows[:, 4] / 10.0)
        group = np.cumsum(np.diff(np.floor(rows[:, 0] / seconds), prepend=-math.inf) != 0) - 1
        rows = np.stack([np.bincount(group, x) / np.bincount(group) for x in rows.T], axis=1)
        moved = lengths(np.diff(rows[:, 1:3], axis=0, prepend=rows[:1, 1:3]))
        rows = rows[(moved > _PACE) | (rows[:, 3] > np.median([0.0, *rows[:, 3]]) / 2)]
        return replace(self, t=rows[:, 0], place=rows[:, 1:4], level=10.0 * np.log10(rows[:, 4]))


@dataclass(frozen=True, slots=True, repr=False)
class LinkFit:
    """A law of the path gain with what is known of its errors; see the module for the equation.

    `reference_gain_db` is the gain at 1 m, within the constant of what was measured; `exponent` is
    n, `elevation_db` are c_1, c_2, ... `errors` are one standard error of these three (0 of a given
    exponent), as shadowing that is so correlated has it; `gain_error_db` is that of the gain where
    it was flown. `spread_db` is the rms of measured against fitted at what was left out of a fit,
    as is `paper_spread_db`, that of d^-2; `correlation_m` is the distance over which the
    correlation of shadowing falls to 1/e. `elevation_deg` and `distance_m` are the least and the
    greatest of the `means`; so many `legs` and `heights` were left out one by one. `flown` are the
    means, `leg` (k,) is the number of each one's leg.

    >>> t = np.arange(0.0, 200.0)
    >>> place = np.stack([300.0 * np.cos(t / 9), 8.0 * t - 700.0, 40.0 + 0.2 * t], axis=1)
    >>> level = -40.0 - 20.0 * np.log10(np.linalg.norm(place, axis=1))
    >>> fit_link([Samples(t, place, level)], seconds=1.0)
    <LinkFit: -40.0 - 20 log10 d dB, spread 0.0 dB of 200 means>
    """

    reference_gain_db: float
    exponent: float
    elevation_db: tuple[float, ...]
    errors: tuple[float, ...]
    gain_error_db: float
    spread_db: float
    paper_spread_db: float
    correlation_m: float
    elevation_deg: tuple[float, float]
    distance_m: tuple[float, float]
    means: int
    legs: int
    heights: int
    flown: Samples
    leg: Integers

    def __str__(self) -> str:
        """Return the law as a sum, of d, m, and of s, the sine of the elevation."""
        text = f"{self.reference_gain_db:.1f} - {10 * self.exponent:.3g} log10 d"
        for power, term in zip(("", "^2", "^3"), self.elevation_db, strict=False):
            text += f" {'-' if term < 0 else '+'} {abs(term):.1f} s{power}"
        return f"{text} dB"

    def __repr__(self) -> str:
        """Say what was found, in a line."""
        return f"<LinkFit: {self}, spread {self.spread_db:.1f} dB of {self.means} means>"

    @property
    def holds(self) -> bool:
        """Whether a law of place says anything: what is left is not beyond `SPREAD_OF_NO_LAW`."""
        return self.spread_db <= SPREAD_OF_NO_LAW

    def gain_db(self, place: Real) -> Real:
        """Return the fitted level, dB, at `place` (..., 3), m from the station's antenna."""
        law = PathGain(10.0 ** (self.reference_gain_db / 10.0), self.exponent, self.elevation_db)
        return law.db(lengths(place[..., :2]), place[..., 2])


def fit_link(flights: Sequence[Samples], seconds: float = 2.0) -> LinkFit:
    """Return the law for what was measured in `flights`, by means over `seconds`.

    Of the laws with the exponent 2 or a free one and up to three terms of the elevation it is that
    with the least rms error at what is left out of the fit: each leg in turn and, where several
    heights were flown, each height. More parameters have to pay. Least squares are robust (Huber).
    Raises `InputError` where there are fewer than ten means in flight, or all at one place or of
    one level.
    """
    flown = [flight.means(seconds) for flight in flights]
    t, place, y = (np.concatenate([getattr(f, x) for f in flown]) for x in ("t", "place", "level"))
    source, counts = ", ".join(dict.fromkeys(f.source for f in flown)), [len(f.t) for f in flown]
    if len(y) < _LEAST or not all(counts):
        text = f"{', '.join(map(str, counts))} means over {seconds:g} s in flight above the station"
        raise InputError(f"{source}: {text}; expected at least {_LEAST}, and some of each")
    if np.ptp(place, axis=0).max() < 1.0:
        raise InputError(f"{source}: one place alone; expected a flight")
    if np.ptp(y) < 1e-6:
        raise InputError(f"{source}: one level alone, {y[0]:g} dB; expected one that changes")
    leg = _legs(flown)
    height = _heights(place[:, 2], leg)
    d, angle = seen(place)
    columns = np.vander(place[:, 2] / d, _TERMS + 1, increasing=True)  # 1, s, s², ...
    columns = np.insert(columns, 1, -10.0 * np.log10(d), axis=1)
    left_y = y - 2.0 * columns[:, 1]  # that level, n - 2 and terms are to tell, a column each
    laws = [[0, *free, *range(2, 2 + terms)] for free in ([], [1]) for terms in range(_TERMS + 1)]
    found: list[tuple[list[int], Real, list[float]]] = []  # each better than those before
    for law in sorted(laws, key=len) if leg.any() else [[0]]:  # of one leg none can be left out
        A, c, errors = columns[:, law], np.zeros(2 + _TERMS), []
        for part in (height, leg):
            if part.any() or part is leg:
                each = _robust(A, left_y, part)
                errors.append(_rms(left_y - np.sum(A * each[part + part.any()], axis=1)))
        c[law] = each[0]
        terms = np.polyval([*c[:1:-1], 0.0], np.linspace(0.0, 1.0, 101))
        sound = 0.0 <= 2.0 + c[1] <= _STEEPEST and np.ptp(terms) <= _SWING
        if not found or (sound and np.mean(errors) < (1.0 - PAYS) * np.mean(found[-1][2])):
            found.append((law, c, errors))
    law, c, (spread, *_) = found[-1]
    A, used, errors_of = columns[:, law], max(law[-1], 1) + 1, np.zeros_like(c)
    length, covariance = _shadowing(place, left_y - columns @ c, A)
    covariance = covariance if leg.any() else np.full_like(covariance, math.inf)
    errors_of[law] = np.sqrt(np.diag(covariance))
    return LinkFit(
        reference_gain_db=float(c[0]),
        exponent=2.0 + float(c[1]),
        elevation_db=tuple(c[2:used].tolist()),
        errors=tuple(errors_of[:used].tolist()),
        gain_error_db=_rms(np.sqrt(np.sum(A @ covariance * A, axis=1))),
        spread_db=spread,
        paper_spread_db=found[0][2][0],
        correlation_m=length,
        elevation_deg=(float(angle.min()), float(angle.max())),
        distance_m=(float(d.min()), float(d.max())),
        means=len(y),
        legs=int(leg[-1]) + 1,
        heights=int(height.max()) + 1,
        flown=Samples(t, place, y, source),
        leg=leg,
    )


def seen(place: Real) -> tuple[Real, Real]:
    """Return distances, m, and elevations, degrees, of `place` (k, 3), m from the antenna."""
    d = np.linalg.norm(place, axis=1)
    return d, np.degrees(np.arcsin(place[:, 2] / d))


def _robust(A: Real, y: Real, part: Integers) -> Real:
    """Return the c (1 + p, m) for which A c is nearest to y, then to it without each `part` (k,).

    By Huber's measure: least squares, reweighted in turn. A single part is never left out.
    """
    kept: Flags = part != np.arange(-1, (part.max() + 1) * part.any())[:, None]
    weight = kept.astype(np.float64)
    for _ in range(_TURNS):
        inverse = np.linalg.pinv((weight[:, None] * A.T) @ A, rcond=_DEPENDENT, hermitian=True)
        c = (inverse @ ((weight * y) @ A)[:, :, None])[:, :, 0]
        away = np.abs(y - c @ A.T)
        middle = np.nanmedian(np.where(kept, away, np.nan), axis=1, keepdims=True)
        near = _ROBUST * np.maximum(1.4826 * middle, _EXACT)
        weight = np.where(kept, np.minimum(1.0, near / np.maximum(away, near)), 0.0)
    return c


def _legs(flown: Sequence[Samples]) -> Integers:
    """Return the number of each mean's leg, (k,): a flight's stretch without a turn."""
    numbers, leg = list[int](), -1
    least = max(_LEAST, sum(len(flight.t) for flight in flown) // _MOST_LEGS)
    for flight in flown:
        steps = np.diff(flight.place[:, :2], axis=0, prepend=flight.place[:1, :2])
        course = np.where(lengths(steps) > _PACE, np.arctan2(*steps.T), math.nan)
        leg, first, count = leg + 1, math.nan, 0
        for toward in course.tolist():
            turned = abs(math.remainder(toward - first, math.tau))
            if turned > _TURN and count >= least:  # a hover, whose course is NaN, does not turn
                leg, first, count = leg + 1, toward, 0
            first = toward if math.isnan(first) else first
            count += 1
            numbers.append(leg)
    return np.array(numbers)


def _heights(up: Real, leg: Integers) -> Integers:
    """Return the number of each mean's height, (k,): that of a level leg, or the nearest one's.

    `up` (k,) are heights, m; those of different numbers are `APART` apart.
    """
    flown = [up[leg == number] for number in range(leg[-1] + 1)]
    level = np.sort([np.median(each) for each in flown if np.ptp(each) < APART])
    cuts = np.flatnonzero(np.diff(level) > APART)
    return np.searchsorted((level[cuts] + level[cuts + 1]) / 2.0, up)


def _shadowing(place: Real, residual: Real, A: Real) -> tuple[float, Real]:
    """Return the L, m, of shadowing with exp(-distance/L), and the covariance of c that it gives.

    What a fit of A c leaves of it has the residuals' size and is nearest to their products.
    """
    from scipy.spatial.distance import cdist

    every = -(-len(residual) // _MOST_PAIRED)
    place, residual, A = place[::every], residual[::every], A[::every]
    away, inverse, best = cdist(place, place), np.linalg.pinv(A), (math.inf, 0.0, A)
    near = np.triu(away < _FAR, 1)
    lag = (away[near] / _LAG).astype(int)
    pairs, total = (np.bincount(lag, x[near]) for x in (near, np.outer(residual, residual)))
    for L in np.geomspace(1.0, np.clip(_LONGEST * away.max(), 1.0, 1000.0), 50).tolist():
        shadow = np.exp(-away / L)
        left = shadow - A @ (inverse @ shadow)
        left -= left @ inverse.T @ A.T
        scale = float(residual @ residual / np.trace(left))
        apart = total - scale * np.bincount(lag, left[near])
        error = float(apart @ (apart / np.maximum(pairs, 1.0)))
        best = min(best, (error, L, scale * inverse @ shadow @ inverse.T), key=lambda x: x[0])
    return best[1:]


def _rms(x: Real) -> float:
    return float(np.sqrt(np.mean(x**2)))
