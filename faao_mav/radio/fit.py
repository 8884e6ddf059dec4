"""The law of a link's path gain, fitted to what was measured in flight.

The law is `gain_db` = level - 10 n log10 d + c_1 s + c_2 s² + ..., with d the distance to the
station's antenna, m, and s = H/d the sine of the elevation at which it sees the UAV. Antennas'
patterns and the ground's reflection are in the terms of s; what no law of place can say, shadowing,
is the spread that is left.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.errors import InputError
from faao_mav.radio.gain import PathGain
from faao_mav.vector import lengths

TERMS = 3
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
"""Metres between heights that are told apart. Chosen: twice what a copter holds."""

_SINES, _POWERS, _SWING = np.linspace(0.0, 1.0, 101)[:, None], np.arange(1, TERMS + 1), 40.0
"""Sines from the horizon to the zenith, and dB by which the terms of the elevation may differ
between them. Chosen: deeper nulls of antennas are no polynomial's, and beyond what was flown one
may do anything."""

_STEEPEST = 10.0
"""The greatest exponent of a law, the least being 0: what a plan takes."""

_PAYS = 0.002
"""The share of the error that more parameters must save. Chosen: less is chance."""

_LAGS, _LENGTHS = np.arange(0.0, 310.0, 10.0), np.geomspace(1.0, 1000.0, 1000)
"""Bounds, m, of the distances between two places at which residuals are compared, and the lengths
of correlation that are tried. Chosen."""

_MOST_PAIRED = 2000
"""Means of a flight that are compared with each other at most, for time and memory. Chosen."""


@dataclass(frozen=True, slots=True)
class Samples:
    """What was measured in a flight: `t` (k,), s, the UAV's `place` (k, 3), m, and `level` (k,).

    Places are east, north and up of the station's antenna. The level is the gain, dB, or the gain
    within a constant, such as a received power, dBm. `source` names the log.

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

    def means(self, seconds: float) -> "Samples":
        """Return means over `seconds` of time, of the power and of the place, in flight.

        That is against fast fading. In flight is above half the median height; what is not finite
        is left out.
        """
        rows = np.column_stack([self.t, self.place, self.level])
        rows = rows[np.isfinite(rows).all(axis=1) & (self.place[:, 2] > 0.0)]
        rows = rows[rows[:, 3] > (0.5 * np.median(rows[:, 3]) if len(rows) else 0.0)]
        rows[:, 4] = 10.0 ** (rows[:, 4] / 10.0)
        group = np.unique(np.floor(rows[:, 0] / seconds), return_inverse=True)[1]
        t, *place, power = (np.bincount(group, x) / np.bincount(group) for x in rows.T)
        return Samples(t, np.stack(place, axis=1), 10.0 * np.log10(power), self.source)


@dataclass(frozen=True, slots=True)
class LinkFit:
    """A law of the path gain with what is known of its errors; see the module for the equation.

    `level` is the gain at 1 m, dB, within the constant of what was measured; `exponent` is n and
    `elevation` are c_1, c_2, ..., dB. `errors` are one standard error of level, exponent (0 where
    it is given) and terms, by leaving out legs one by one; `error` is that of the gain where it was
    flown, dB. `spread` is the rms of measured against fitted, dB, at what was left out of a fit, as
    is `paper_spread`, that of d^-2; `correlation` is the distance, m, over which the correlation of
    residuals falls to 1/e. `flights` are the means it rests on; `legs` and `heights` are how many
    were left out one by one.

    >>> fit = LinkFit(-48.5, 2.0, (54.48, -75.2), (), 0, 6.2, 7.5, 80.0, 4, 1, ())
    >>> fit.exponent, fit.spread < fit.paper_spread
    (2.0, True)
    """

    level: float
    exponent: float
    elevation: tuple[float, ...]
    errors: tuple[float, ...]
    error: float
    spread: float
    paper_spread: float
    correlation: float
    legs: int
    heights: int
    flights: tuple[Samples, ...]

    def __repr__(self) -> str:
        """Say what was found, in a line."""
        terms = ", ".join(f"{term:.1f}" for term in self.elevation)
        law = f"{self.level:.1f} dB at 1 m, n = {self.exponent:.2f}, elevation [{terms}]"
        return f"<LinkFit: {law}, spread {self.spread:.1f} dB of {self.count} means>"

    @property
    def place(self) -> Real:
        """Where the means were flown, (k, 3), m east, north and up of the antenna."""
        return np.concatenate([flight.place for flight in self.flights])

    @property
    def distance_m(self) -> tuple[float, float]:
        """The least and the greatest distance of the means, m."""
        d, _ = seen(self.place)
        return float(d.min()), float(d.max())

    @property
    def elevation_deg(self) -> tuple[float, float]:
        """The least and the greatest elevation at which the antenna saw them, degrees."""
        _, angle = seen(self.place)
        return float(angle.min()), float(angle.max())

    @property
    def holds(self) -> bool:
        """Whether a law of place says anything: what is left is not beyond `SPREAD_OF_NO_LAW`."""
        return self.spread <= SPREAD_OF_NO_LAW

    @property
    def count(self) -> int:
        """The number of means."""
        return sum(len(flight.t) for flight in self.flights)

    def gain_db(self, place: Real) -> Real:
        """Return the fitted level, dB, at `place` (..., 3), m from the station's antenna."""
        law = PathGain(10.0 ** (self.level / 10.0), self.exponent, self.elevation)
        return law.db(lengths(place[..., :2]), place[..., 2])


def seen(place: Real) -> tuple[Real, Real]:
    """Return distances, m, and elevations, degrees, of `place` (k, 3), m from the antenna."""
    d = np.linalg.norm(place, axis=1)
    return d, np.degrees(np.arcsin(place[:, 2] / d))


def fit_link(flights: Sequence[Samples], seconds: float = 2.0) -> LinkFit:
    """Return the law for what was measured in `flights`, by means over `seconds`.

    Of the laws with the exponent 2 or a free one and up to `TERMS` terms of the elevation it is
    that with the least rms error at what is left out of the fit: each leg in turn and, where
    several heights were flown, each height. More parameters have to pay. Least squares are robust
    (Huber). Raises `InputError` where there are fewer than ten means in flight, or all at one
    place.

    >>> t = np.arange(0.0, 200.0)
    >>> place = np.stack([300.0 * np.cos(t / 9), 8.0 * t - 700.0, 40.0 + 0.2 * t], axis=1)
    >>> level = -40.0 - 20.0 * np.log10(np.linalg.norm(place, axis=1))
    >>> fit = fit_link([Samples(t, place, level)], seconds=1.0)
    >>> round(fit.level, 6), fit.exponent, fit.holds
    (-40.0, 2.0, True)
    """
    means = tuple(flight.means(seconds) for flight in flights)
    place = np.concatenate([each.place for each in means])
    level = np.concatenate([each.level for each in means])
    source, counts = ", ".join(each.source for each in means), [len(each.t) for each in means]
    if len(level) < _LEAST or not all(counts):
        text = f"{', '.join(map(str, counts))} means over {seconds:g} s in flight"
        raise InputError(f"{source}: {text}; expected at least {_LEAST}, and some of each")
    if np.ptp(place, axis=0).max() < 1.0:
        raise InputError(f"{source}: one place alone; expected a flight")
    legs = legs_of(means)
    heights = _heights(place[:, 2], legs)
    parts = [part for part in (legs, heights) if part.max() > 0]
    d, every = np.linalg.norm(place, axis=1), np.ones((1, len(level)), dtype=np.bool_)
    slope, s = -10.0 * np.log10(d), place[:, 2] / d
    columns = np.stack([np.ones_like(d), slope, *(s**k for k in _POWERS)], axis=1)
    y = level - 2.0 * slope  # that level, n - 2 and terms are to tell, a column each
    laws = [[0, *free, *range(2, 2 + terms)] for free in ([], [1]) for terms in range(TERMS + 1)]
    fits = []
    for law in sorted(laws, key=len) if parts else [[0]]:  # of one leg none can be left out
        A, c = columns[:, law], np.zeros(columns.shape[1])
        c[law] = _robust(A, y, every)[0]
        told = [np.sum(A * _without(A, y, part)[part], axis=1) for part in parts]
        fits.append((law, c, [_rms(y - each) for each in told or [columns @ c]]))
    law, c, spread = fits[0]
    for more, tried, left in fits:
        pays = np.mean(left) < (1.0 - _PAYS) * np.mean(spread)
        if (
            pays
            and 0.0 <= 2.0 + tried[1] <= _STEEPEST
            and np.ptp(_SINES**_POWERS @ tried[2:]) <= _SWING
        ):
            law, c, spread = more, tried, left
    count, away = int(legs.max()) + 1, np.full((1, 1), math.inf)
    if count > 1:
        without = _without(columns[:, law], y, legs)
        away = np.sqrt((count - 1) / count) * (without - without.mean(axis=0))  # the jackknife
    errors, used = np.zeros_like(c), max(law[-1], 1) + 1
    errors[law] = np.linalg.norm(away, axis=0)
    return LinkFit(
        level=float(c[0]),
        exponent=2.0 + float(c[1]),
        elevation=tuple(c[2:used].tolist()),
        errors=tuple(errors[:used].tolist()),
        error=_rms(np.linalg.norm(columns[:, law] @ away.T, axis=1)),
        spread=spread[-1],
        paper_spread=fits[0][2][-1],
        correlation=_correlation(means, y - columns @ c),
        legs=count,
        heights=int(heights.max()) + 1,
        flights=means,
    )


def _robust(A: Real, y: Real, kept: Flags) -> Real:
    """Return the c (p, m) for which A c is nearest to those of y that are `kept` (p, k).

    By Huber's measure: least squares, reweighted in turn.
    """
    weight = kept.astype(np.float64)
    for _ in range(_TURNS):
        inverse = np.linalg.pinv((weight[:, None] * A.T) @ A, rcond=_DEPENDENT, hermitian=True)
        c = (inverse @ ((weight * y) @ A)[:, :, None])[:, :, 0]
        away = np.abs(y - c @ A.T)
        middle = np.nanmedian(np.where(kept, away, np.nan), axis=1, keepdims=True)
        near = _ROBUST * np.maximum(1.4826 * middle, _EXACT)
        weight = np.where(kept, np.minimum(1.0, near / np.maximum(away, near)), 0.0)
    return c


def _without(A: Real, y: Real, part: Integers) -> Real:
    """Return the c (p, m) of fits from which each `part` (k,) in turn is left out."""
    return _robust(A, y, part != np.arange(part.max() + 1)[:, None])


def legs_of(means: Sequence[Samples]) -> Integers:
    """Return the number of each mean's leg, (k,): a flight's stretch without a turn."""
    numbers, leg = list[int](), -1
    least = max(_LEAST, sum(len(flight.t) for flight in means) // _MOST_LEGS)
    for flight in means:
        steps = np.diff(flight.place[:, :2], axis=0, prepend=flight.place[:1, :2])
        course = np.where(np.hypot(*steps.T) > _PACE, np.arctan2(*steps.T), math.nan)
        leg, first, count = leg + 1, math.nan, 0
        for toward in course.tolist():
            turned = abs(math.remainder(toward - first, 2.0 * math.pi))
            if turned > _TURN and count >= least:  # a hover, whose course is NaN, does not turn
                leg, first, count = leg + 1, toward, 0
            first = toward if math.isnan(first) else first
            count += 1
            numbers.append(leg)
    return np.array(numbers)


def _heights(up: Real, legs: Integers) -> Integers:
    """Return the number of each mean's height, (k,): that of a level leg, or the nearest one's.

    `up` (k,) are heights, m; those of different numbers are `APART` apart.
    """
    flown = [up[legs == leg] for leg in range(int(legs.max()) + 1)]
    level = np.sort([np.median(leg) for leg in flown if np.ptp(leg) < APART])
    if len(level) == 0:
        return np.zeros(len(up), dtype=np.int_)
    cuts = np.flatnonzero(np.diff(level) > APART)
    return np.searchsorted((level[cuts] + level[cuts + 1]) / 2.0, up)


def _correlation(means: Sequence[Samples], residual: Real) -> float:
    """Return the L, m, for which exp(-distance/L) is nearest to the residuals' correlation."""
    from scipy.spatial.distance import pdist

    total, pairs = np.zeros((2, len(_LAGS) - 1))
    ends = np.cumsum([len(flight.t) for flight in means])
    for flight, rest in zip(means, np.split(residual, ends[:-1]), strict=True):
        every = -(-len(rest) // _MOST_PAIRED)
        away, (i, k) = pdist(flight.place[::every]), np.triu_indices(-(-len(rest) // every), 1)
        total += np.histogram(away, _LAGS, weights=rest[::every][i] * rest[::every][k])[0]
        pairs += np.histogram(away, _LAGS)[0]
    power = float(np.mean(residual**2))
    if power == 0.0:
        return 0.0
    found, L = pairs > 0, _LENGTHS[:, None]
    model = np.exp(-(_LAGS[:-1] + 5.0)[found] / L)
    apart = pairs[found] * (total[found] / pairs[found] / power - model) ** 2
    return float(_LENGTHS[apart.sum(axis=1).argmin()])


def _rms(x: Real) -> float:
    return float(np.sqrt(np.mean(x**2)))
