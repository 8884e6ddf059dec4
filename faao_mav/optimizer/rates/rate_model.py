"""Choose for each link of a plan the quickest exact rate model; tables over distance and direction.

Without known draws the best rate depends on the distance alone: the distribution of the fading does
not change when the line of sight is rotated, and precoders undo the rotation. It is then one curve,
tabulated once. A classical scheme does not rotate its streams with the arrays, so that its rate
depends on the direction too: a surface. With a draw known for every slot the slots differ, but
links of two modes at most share one function of their singular values.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from faao_mav.arrays import Complex, Flags, Integers, Real
from faao_mav.optimizer.design import Design
from faao_mav.optimizer.problem import Link
from faao_mav.optimizer.rates import DirectionPartials, RateModel, RatePartials
from faao_mav.optimizer.rates.mode_rate import has_few_modes, mode_rate
from faao_mav.optimizer.rates.slot_rate import BestRate, DifferencedRate
from faao_mav.optimizer.rates.spline import BicubicSpline, CubicSpline

_CURVE_POINTS = 49
_SURFACE_POINTS = (49, 65)
"""Grid points of a curve over l, and of a surface over l and u.
Chosen so that tables differ from exact rates by less than 2e-4 bit in the tests
(test_rate_models.py)."""

_SEARCH_EVERY = 16
"""Every so many points of a curve the best precoders are searched from all starts; between, from
those next to them: a power of two, of which the points of a curve are one more than a multiple.

Measured on six curves of QPSK and 16-QAM beside every eighth, with 60 % of Newton's sums: the mean
rate is at most 2e-5 bit lower on two antennas, and 6e-4 to 3e-3 bit higher with QPSK on three.
"""

_ALIKE = 0.3
"""The distance, in their size, up to which precoders of neighbouring points are of one kind: those
between serve as starts. Chosen."""

_SAME = 1e-6
"""Gain, bit, below which a precoder found from another start is the same, in another form. Those of
a kind then stay in one form along the curve. Chosen."""


@dataclass(frozen=True, slots=True, eq=False)
class CurveRate:
    """A rate that depends on l alone: a cubic spline through exact values.

    `precoders` ((S,) m, N_t, N_t) are those of the grid `gain_log` (m,) at u = 0.
    """

    link: Link
    spline: CubicSpline
    gain_log: Real
    precoders: Complex

    def value(self, gain_log: Real, cosine: Real) -> Real:  # noqa: ARG002
        """Return the rate R of every slot, bits (..., n)."""
        return self.spline(gain_log)

    def partials(self, gain_log: Real, cosine: Real) -> RatePartials:  # noqa: ARG002
        """Return the rate and its derivatives by l, bits (..., n)."""
        return RatePartials(*self.spline.partials(gain_log))

    def initial_precoders(self, gain_log: Real, cosine: Real) -> Complex:
        """Return precoders ((S,) n, N_t, N_t) close to the best at l and u (n,).

        They are those between the grid points about l, or of the nearest where these are of two
        kinds, rotated from u = 0 to u.
        """
        last = len(self.gain_log) - 1
        step = self.gain_log[1] - self.gain_log[0]
        place = np.clip((gain_log - self.gain_log[0]) / step, 0, last)
        below = np.minimum(place.astype(np.intp), last - 1)
        here, there = self.precoders[..., below, :, :], self.precoders[..., below + 1, :, :]
        near = _between(here, there, place - below)
        steering = self.link.line_of_sight_at(cosine)[:, 0]  # conj(D_t): D_r is 1 at antenna 0
        return np.asarray(np.conj(steering)[:, :, None] * near)


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceRate:
    """A rate that depends on l and u: a bicubic spline through exact values."""

    spline: BicubicSpline

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate R of every slot, bits (..., n)."""
        return self.spline.value(gain_log, self.spline.locate(cosine))

    def partials(self, gain_log: Real, cosine: Real) -> RatePartials:
        """Return the rate and its derivatives by l and u, bits (..., n)."""
        value, by_l, by_u, by_ll, by_lu, by_uu = self.spline.by_both(
            gain_log, self.spline.locate(cosine)
        )
        return RatePartials(value, by_l, by_ll, DirectionPartials(by_u, by_lu, by_uu))


def rate_model(link: Link, design: Design, farthest: float) -> RateModel:
    """Return the rate model of `link` under `design`.

    `farthest` is the largest horizontal distance from the station, in metres, that it covers.
    """
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
    """Return the rate of `link` tabulated from l = `least` to l = `most`."""
    gain_log = _grid(least, most, _CURVE_POINTS)
    H_r = link.fade(link.line_of_sight_at(np.zeros(len(gain_log))))
    H = np.exp(gain_log / 2)[:, None, None] * H_r
    if not design.optimal:
        P = design.precoders(link, H)
    elif link.measure == "cutoff" or design.blind or not (design.averaged and has_few_modes(link)):
        P = _along(link, design, H)
    else:  # one for each draw: those of the table of modes
        P = mode_rate(link, least, most).initial_precoders(gain_log, 0 * gain_log)
    return CurveRate(link, CubicSpline.through(gain_log, design.rate(link, H, P)), gain_log, P)


def _along(link: Link, design: Design, H: Complex) -> Complex:
    """Return the best precoders ((S,) m, N_t, N_t) of the channels H along the grid of a curve.

    Every `_SEARCH_EVERY`-th point is searched from all starts, and from the results of those next
    to it. Halfway between two points that are known the search starts from both, or where they are
    of one kind from between, until all are. The better is kept: where two kinds of precoder cross,
    the curve follows the upper one.
    """
    points = H.shape[-3]
    searched = np.arange(0, points, _SEARCH_EVERY)
    P = np.repeat(design.precoders(link, H[..., searched, :, :]), _SEARCH_EVERY, axis=-3)
    P = P[..., :points, :, :]
    rate = np.full(points, -np.inf)
    rate[searched] = design.rate(link, H[..., searched, :, :], P[..., searched, :, :])

    def try_from(at: Integers, start: Complex) -> None:
        tried = design.precoders(link, H[..., at, :, :], start=start)
        reached = design.rate(link, H[..., at, :, :], tried)
        better = reached > rate[at] + _SAME
        rate[at[better]] = reached[better]
        P[..., at[better], :, :] = tried[..., better, :, :]

    for _ in range(2):
        try_from(searched[1:], P[..., searched[:-1], :, :])
        try_from(searched[:-1], P[..., searched[1:], :, :])
    step = _SEARCH_EVERY
    while step > 1:
        step //= 2
        at = np.arange(step, points - step, 2 * step)
        below, above = P[..., at - step, :, :], P[..., at + step, :, :]
        try_from(at, _between(below, above, np.full(len(at), 0.5)))
        other = np.any(~_alike(below, above).reshape(-1, len(at)), axis=0)  # of any of the draws
        try_from(at[other], above[..., other, :, :])
    return P


def _alike(here: Complex, there: Complex) -> Flags:
    """Return whether precoders (..., N_t, N_t) are of one kind, so that those between are near."""
    apart = np.linalg.norm(there - here, axis=(-2, -1))
    return np.asarray(apart < _ALIKE * np.linalg.norm(here, axis=(-2, -1)))


def _between(here: Complex, there: Complex, share: Real) -> Complex:
    """Return precoders at a `share` (n,) of the way, the nearest of two that are not alike."""
    part = np.where(_alike(here, there), share, np.rint(share))[..., None, None]
    return np.asarray(here + part * (there - here))


def _grid(least: float, most: float, points: int) -> Real:
    margin = 0.01 * (most - least) + 1e-6
    return np.linspace(least - margin, most + margin, points)


def _surface(link: Link, design: Design, least: float, most: float) -> SurfaceRate:
    gain_log = _grid(least, most, _SURFACE_POINTS[0])
    cosine = np.linspace(-1, 1, _SURFACE_POINTS[1])
    H_r = link.fade(link.line_of_sight_at(np.tile(cosine, len(gain_log))))
    H = np.exp(np.repeat(gain_log, len(cosine)) / 2)[:, None, None] * H_r
    rate = _rate(link, design, H).reshape(len(gain_log), len(cosine))
    return SurfaceRate(BicubicSpline.through(gain_log, cosine, rate))


def _rate(link: Link, design: Design, H: Complex) -> Real:
    return design.rate(link, H, design.precoders(link, H))
