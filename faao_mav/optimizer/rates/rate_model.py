"""Choose for each link the quickest exact form of its rate as a function of the position.

Without known draws the best rate depends on the distance alone: by the symmetry of the fading, a
turn of the line of sight is undone by turning the precoders. It is then one curve, tabulated once.
A scheme that does not turn its streams with the arrays depends on the direction too: a surface.
With a draw known for every slot the slots differ, but links with two modes share one function of
their singular values.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.design import Design
from faao_mav.optimizer.problem import Link
from faao_mav.optimizer.rates.bicubic import Bicubic
from faao_mav.optimizer.rates.mode_rate import has_few_modes, mode_rate
from faao_mav.optimizer.rates.place import Partials, PlaceRate, Turning
from faao_mav.optimizer.rates.slot_rate import BestRate, DifferencedRate
from faao_mav.optimizer.rates.spline import Spline

_CURVE_POINTS = 97
_SEARCH_EVERY = 12
_SURFACE_POINTS = (49, 65)


@dataclass(frozen=True, slots=True, eq=False)
class CurveRate:
    """A rate that depends on l alone: a cubic spline through exact values.

    `precoders` ((S,) m, N_t, N_t) are those of the grid `gain_log` (m,) at u = 0.
    """

    link: Link
    spline: Any
    gain_log: Real
    precoders: Complex

    def value(self, gain_log: Real, cosine: Real) -> Real:  # noqa: ARG002
        """Return the rate of every slot, bits (..., n)."""
        return np.asarray(self.spline(gain_log))

    def partials(self, gain_log: Real, cosine: Real) -> Partials:  # noqa: ARG002
        """Return the rate and its derivatives by l."""
        value, by_l, by_ll = (np.asarray(self.spline(gain_log, k)) for k in range(3))
        return Partials(value, by_l, by_ll)

    def start(self, gain_log: Real, cosine: Real) -> Complex:
        """Return nearly the best precoders ((S,) n, N_t, N_t): the grid's, turned to u."""
        step = self.gain_log[1] - self.gain_log[0]
        nearest = np.rint((gain_log - self.gain_log[0]) / step).astype(np.intp)
        steering = self.link.line_of_sight_at(cosine)[:, 0]  # conj(D_t): D_r is 1 at antenna 0
        found = self.precoders[..., np.clip(nearest, 0, len(self.gain_log) - 1), :, :]
        return np.asarray(np.conj(steering)[:, :, None] * found)


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceRate:
    """A rate that depends on l and u: a bicubic spline through exact values."""

    spline: Bicubic

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate of every slot, bits (..., n)."""
        return self.spline.value(gain_log, self.spline.rows(cosine))

    def partials(self, gain_log: Real, cosine: Real) -> Partials:
        """Return the rate and its derivatives by l and u."""
        value, by_l, by_u, by_ll, by_lu, by_uu = self.spline.by_both(
            gain_log, self.spline.rows(cosine)
        )
        return Partials(value, by_l, by_ll, Turning(by_u, by_lu, by_uu))


def rate_model(link: Link, design: Design, farthest: float) -> PlaceRate:
    """Return the rate of `link` under `design`, up to `farthest` metres (horizontal) away."""
    nearest = np.log(link.reference_gain / link.altitude**2)
    least = np.log(link.reference_gain / (farthest**2 + link.altitude**2))
    if link.nlos is not None and not design.averaged:
        if not design.optimal:
            return DifferencedRate(link, partial(_rate, link, design))
        return mode_rate(link, least, nearest) if has_few_modes(link) else BestRate(link)
    if design.optimal or (design.gaussian and design.scheme == "faao") or not link.follows_position:
        return best_curve(link, design, least, nearest)
    return _surface(link, design, least, nearest)


def best_curve(link: Link, design: Design, least: float, most: float) -> CurveRate:
    """Tabulate the rate of `link` between two logarithms of the path gain."""
    gain_log = _grid(least, most, _CURVE_POINTS)
    H_r = link.fade(link.line_of_sight_at(np.zeros(len(gain_log))))
    H = np.exp(gain_log / 2)[:, None, None] * H_r
    P = _along(link, design, H) if design.optimal else design.precoders(link, H)
    return CurveRate(link, Spline.through(gain_log, design.rate(link, H, P)), gain_log, P)


def _along(link: Link, design: Design, H: Complex) -> Complex:
    """The best precoders along the grid: searched from all starts here and there, followed between.

    Every point is reached from the searched point below and from the one above, and takes the
    better: where two kinds of precoder cross, the curve keeps the upper one.
    """
    points = H.shape[-3]
    searched = np.arange(0, points, _SEARCH_EVERY)
    P = design.precoders(link, H[..., searched, :, :])
    below = np.arange(points) // _SEARCH_EVERY
    above = np.minimum(below + 1, len(searched) - 1)
    best, rate = None, None
    for neighbour in (below, above):
        found = design.precoders(link, H, start=P[..., neighbour, :, :])
        reached = design.rate(link, H, found)
        if best is None or rate is None:
            best, rate = found, reached
        else:
            better = (reached > rate)[:, None, None]
            best = np.where(better, found, best)
    assert best is not None
    return best


def _grid(least: float, most: float, points: int) -> Real:
    margin = 0.01 * (most - least) + 1e-6
    return np.linspace(least - margin, most + margin, points)


def _surface(link: Link, design: Design, least: float, most: float) -> SurfaceRate:
    gain_log = _grid(least, most, _SURFACE_POINTS[0])
    cosine = np.linspace(-1, 1, _SURFACE_POINTS[1])
    H_r = link.fade(link.line_of_sight_at(np.tile(cosine, len(gain_log))))
    H = np.exp(np.repeat(gain_log, len(cosine)) / 2)[:, None, None] * H_r
    rate = _rate(link, design, H).reshape(len(gain_log), len(cosine))
    return SurfaceRate(Bicubic.through(gain_log, cosine, rate))


def _rate(link: Link, design: Design, H: Complex) -> Real:
    return design.rate(link, H, design.precoders(link, H))
