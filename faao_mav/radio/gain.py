"""The path gain of a link as a function of place: the law that everything else asks.

In dB it is

    rho_0 - 10 n log10(d) + c_1 s + c_2 s^2 + c_3 s^3,  s = H / d,

with d the distance between the antennas, m, and H the height of the one over the other, so that s
is the sine of the elevation. The paper's rho_0 d^-2 is n = 2 without elevation terms. What the
antennas' patterns and the ground do over the elevation is in c_1 to c_3.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Integers, Real, products
from faao_mav.radio.gain_map import Grid
from faao_mav.radio.spline import Spline, polynomial

PER_DB = float(np.log(10.0) / 10.0)
"""The natural logarithm of a gain of 1 dB."""

_STEP = 1e-3
"""Step of ln d² in central differences: second derivatives of logarithms err by some 1e-6."""

_REAL = 1e-6
"""The imaginary part, in its size, up to which a root is real: a double root splits by rounding. A
distance too many does no harm."""

_SAMPLES = 500
"""Distances at which it is looked where a law turns that does not tell it. Chosen."""


class GainFunction(ABC):
    """A law of the path gain by distance and height: one's own is a subclass with `log`.

    >>> class Free(GainFunction):
    ...     def log(self, squared_distance, height):
    ...         return np.log(1e-5 / squared_distance)
    >>> float(Free().db(np.array(30.0), 40.0).round(2))
    -83.98
    """

    @abstractmethod
    def log(self, squared_distance: Real, height: float | Real) -> Real:
        """Return l, the natural logarithm of the linear gain, (...), smooth.

        At d² (...), m², the one antenna `height` m above the other.
        """

    def db(self, distance: Real, height: float | Real) -> Real:
        """Return the gain in dB at horizontal distances (...), m."""
        return self.log(np.asarray(distance) ** 2 + height**2, height) / PER_DB

    def by_log_distance(self, squared_distance: Real, height: float) -> tuple[Real, Real]:
        """Return l_t and l_tt (...) by t = ln d²: here by central differences."""
        low, middle, high = (
            self.log(squared_distance * np.exp(step), height) for step in (-_STEP, 0.0, _STEP)
        )
        return (high - low) / (2 * _STEP), (high - 2 * middle + low) / _STEP**2

    def turns(self, farthest: float, height: float) -> Real:
        """Return where l turns, as distances on the ground (k,) from 0 to `farthest`, m.

        Between two of them l is monotone: the extreme gains up to `farthest` are at two of them.
        """
        distances = np.linspace(0.0, farthest, _SAMPLES)
        rises = np.diff(self.log(distances**2 + height**2, height)) > 0
        return distances[[0, *(1 + np.flatnonzero(np.diff(rises))), -1]]


@dataclass(frozen=True)
class PathGain(GainFunction):
    """A law of the path gain: rho_0 = `reference_gain` (linear, at 1 m), n, and c_1, c_2, ... (dB).

    >>> law = PathGain(1e-5, elevation_db=(6.0, -2.0))
    >>> law.db(np.array([0.0, 30.0]), 40.0).round(2)  # s = 1 and s = 0.8
    array([-78.04, -80.46])
    """

    reference_gain: float
    exponent: float = 2.0
    elevation_db: tuple[float, ...] = ()

    def log(self, squared_distance: Real, height: float | Real) -> Real:
        """Return l, the natural logarithm of the linear gain, (...)."""
        by_distance = np.log(self.reference_gain) - self.exponent / 2 * np.log(squared_distance)
        s = height / np.sqrt(squared_distance)
        return np.asarray(by_distance + polynomial(self._terms, s))

    def turns(self, farthest: float, height: float) -> Real:
        """Return where l turns, as distances on the ground (k,) from 0 to `farthest`, m.

        >>> PathGain(1e-5).turns(900.0, 100.0).tolist()
        [0.0, 900.0]
        >>> PathGain(1e-5, elevation_db=(0.0, -10.0)).turns(900.0, 100.0).round(1).tolist()
        [0.0, 114.1, 900.0]
        """
        by_s = np.arange(len(self._terms) - 1, 0, -1) * self._terms[:-1]  # d s / d ln d² is -s/2
        roots = np.sign(height) * np.roots([*by_s, self.exponent])
        s = roots.real[np.abs(roots.imag) < _REAL * np.abs(roots)]
        found = np.abs(height) * np.sqrt(1 / s[(s > 0) & (s <= 1)] ** 2 - 1)
        return np.array([0.0, *np.sort(found[found < farthest]), farthest])

    @property
    def _terms(self) -> Real:
        """The terms of the elevation, natural logarithms, by powers of s, the highest first."""
        return PER_DB * np.array([*self.elevation_db[::-1], 0.0])


@dataclass(frozen=True, eq=False)
class GainField:
    """The path gain of a hop over the map: its law about the station, and what lies above it.

    In natural logarithms, at a place w of the aircraft in slot n,

        l_n(w) = law(||w - p_n||^2 + H^2) + above(w)

    with H the `height` of the aircraft above the station, m, and p_n the `station`: (2,), or (n, 2)
    where it moves, its places in the n slots, m. `above` are dB of a map, by default nothing.

    >>> field = GainField(PathGain(1e-5), np.array([0.0, 30.0]), 40.0)
    >>> (field.log(np.array([[0.0], [0.0]])) / PER_DB).round(2)  # d = 50 m
    array([-83.98])
    """

    law: GainFunction
    station: Real
    height: float
    above: Spline | None = None

    @property
    def square(self) -> bool:
        """Whether this is the paper's rho_0 d^-2, without a map."""
        law = self.law
        paper = isinstance(law, PathGain) and law.exponent == 2 and not any(law.elevation_db)
        return paper and self.above is None

    @property
    def midway(self) -> Real:
        """Where the station is at half the time of the flight (2,), m."""
        p, n = self.station, len(self.station)
        return p if p.ndim == 1 else (p[(n - 1) // 2] + p[n // 2]) / 2

    def in_slots(self, chosen: Integers | int) -> "GainField":
        """Return the field with the places of the station in the slots `chosen` (k,) or ()."""
        return self if self.station.ndim == 1 else replace(self, station=self.station[chosen])

    def smoothed(self) -> "GainField":
        """Return the field with its map as the optimiser searches on it."""
        smooth = self.above.smoothed() if isinstance(self.above, Grid) else self.above
        return replace(self, above=smooth)

    def away(self, w: Real) -> Real:
        """Return w - p (2, ..., n) at positions w (2, ..., n), m."""
        return w - self.station.T.reshape(2, *[1] * (w.ndim - 2), -1)

    def squared_distance(self, away: Real) -> Real:
        """Return d² (...), m², of the antennas at w - p = `away` (2, ...)."""
        return np.asarray(np.sum(away**2, axis=0) + self.height**2)

    def log(self, w: Real) -> Real:
        """Return l (..., n) at positions w (2, ..., n), m."""
        found = self.law.log(self.squared_distance(self.away(w)), self.height)
        return found if self.above is None else found + PER_DB * self.above.value(*w)

    def gain(self, w: Real) -> Real:
        """Return the linear gain (..., n) at positions w (2, ..., n), m."""
        return np.asarray(np.exp(self.log(w)))

    def slopes(self, w: Real) -> tuple[Real, Real]:
        """Return gradient (2, ..., n) and Hessian xx, xy, yy (3, ..., n) of l by w (2, ..., n).

        By the law they are those of t = ln d² times l_t and l_tt.
        """
        away = self.away(w)
        d2 = self.squared_distance(away)
        by_t, bent = self.law.by_log_distance(d2, self.height)
        t_i = 2 * away / d2
        gradient, hessian = by_t * t_i, (bent - by_t) * products(t_i, t_i)
        hessian[[0, 2]] += by_t * (2 / d2)
        if self.above is not None:
            _, x, y, xx, xy, yy = self.above.by_both(*w)
            gradient = gradient + PER_DB * np.stack([x, y])
            hessian = hessian + PER_DB * np.stack([xx, xy, yy])
        return gradient, hessian

    def extremes(self, farthest: float) -> tuple[float, float]:
        """Return what l is not below and not above up to `farthest` m from the station."""
        found = self._by_law(self.law.turns(farthest, self.height))
        above = PER_DB * self.above.values if isinstance(self.above, Grid) else np.zeros(1)
        return float(found.min() + above.min()), float(found.max() + above.max())

    def most_between(self, near: Real, far: Real) -> Real:
        """Return the most of l (...) by the law at distances from `near` to `far` (...), m."""
        turns = self.law.turns(float(far.max()), self.height)
        inside = np.clip(turns.reshape(-1, *[1] * max(near.ndim, far.ndim)), near, far)
        return np.asarray(self._by_law(inside).max(axis=0))

    def _by_law(self, distance: Real) -> Real:
        """Return l (...) by the law at distances on the ground (...), m."""
        return np.asarray(self.law.log(distance**2 + self.height**2, self.height))
