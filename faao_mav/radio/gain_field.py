"""The path gain of a hop over the map: its law about the station, and what lies above it by place.

In natural logarithms, at a place w of the aircraft in slot n,

    l_n(w) = law(||w - p_n||^2 + H^2) + above(w)

with p_n the place of the station, which may move, and `above`, by default nothing, from a map.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.radio.gain import PER_DB, GainFunction
from faao_mav.radio.gain_map import Grid


class Surface(Protocol):
    """A function f of the place (x, y), m; beyond its edge that of the nearest point on it."""

    def value(self, x: Real, y: Real) -> Real:
        """Return f at x (...) and y (...)."""

    def by_both(self, x: Real, y: Real) -> tuple[Real, Real, Real, Real, Real, Real]:
        """Return f, f_x, f_y, f_xx, f_xy and f_yy, where they exist."""


@dataclass(frozen=True, eq=False)
class GainField:
    """The path gain of a hop, the aircraft `height` m above the station, which is at `station`, m.

    `station` is (2,), or (n, 2) where it moves: its places in the n slots. `above` are dB over the
    `law`.

    >>> from faao_mav.radio.gain import PathGain
    >>> field = GainField(PathGain(1e-5), np.array([0.0, 30.0]), 40.0)
    >>> (field.log(np.array([[0.0], [0.0]])) / PER_DB).round(2)  # d = 50 m
    array([-83.98])
    """

    law: GainFunction
    station: Real
    height: float
    above: Surface | None = None

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
        found = self.law.gain(self.squared_distance(self.away(w)), self.height)
        return found if self.above is None else found * np.exp(PER_DB * self.above.value(*w))

    def slopes(self, w: Real) -> tuple[Real, Real]:
        """Return gradient (2, ..., n) and Hessian xx, xy, yy (3, ..., n) of l by w (2, ..., n)."""
        away = self.away(w)
        gradient, hessian = self.law.slopes(away, self.squared_distance(away), self.height)
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
        most = np.maximum(self._by_law(near), self._by_law(far))
        for turn in self.law.turns(float(far.max()), self.height)[1:-1]:
            most = np.where(
                (near < turn) & (turn < far), np.maximum(most, self._by_law(turn)), most
            )
        return most

    def _by_law(self, distance: Real) -> Real:
        """Return l (...) by the law at distances on the ground (...), m."""
        return np.asarray(self.law.log(distance**2 + self.height**2, self.height))
