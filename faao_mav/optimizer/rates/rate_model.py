"""Choose for each link of a plan the quickest exact rate model; tables over distance and direction.

Without known draws the best rate depends on the distance alone: the distribution of the fading does
not change when the line of sight is rotated, and precoders undo the rotation. It is then one curve,
tabulated once. A classical scheme does not rotate its streams with the arrays, so that its rate
depends on the direction too: a surface. With a draw known for every slot the slots differ, but
links of two modes at most share one function of their singular values.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from faao_mav.arrays import Complex, Flags, Integers, Real
from faao_mav.optimizer.design import Design
from faao_mav.optimizer.problem import Link
from faao_mav.optimizer.rates import DirectionPartials, RateModel, RatePartials
from faao_mav.optimizer.rates.mode_rate import has_few_modes, mode_rates
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


def rate_models(
    links: Sequence[Link], design: Design, farthest: Sequence[float]
) -> tuple[RateModel, ...]:
    """Return the rate model of each of the `links` under `design`.

    `farthest` are the largest horizontal distances from their stations, in metres, that they cover.
    """
    ranges = []
    for link, distance in zip(links, farthest, strict=True):
        squared_distance = np.array([distance, 0.0]) ** 2 + link.altitude**2
        ranges.append(np.log(link.reference_gain / squared_distance))
    if all(_depends_on_distance_alone(link, design) for link in links):
        return best_curves(links, design, ranges)
    if design.optimal and all(has_few_modes(link) for link in links):
        return mode_rates(links, ranges)
    return tuple(_model(link, design, span) for link, span in zip(links, ranges, strict=True))


def _depends_on_distance_alone(link: Link, design: Design) -> bool:
    if link.nlos is not None and not design.averaged:
        return False
    gaussian = design.gaussian and design.scheme == "faao"
    return design.optimal or gaussian or not link.follows_position


def _model(link: Link, design: Design, span: Real) -> RateModel:
    """Return the model of one link from the least to the largest l, `span` (2,)."""
    if _depends_on_distance_alone(link, design):
        return best_curves([link], design, [span])[0]
    if link.nlos is None or design.averaged:
        return _surface(link, design, *span)
    if not design.optimal:
        return DifferencedRate(link, partial(_rate, link, design))
    return mode_rates([link], [span])[0] if has_few_modes(link) else BestRate(link)


def best_curves(
    links: Sequence[Link], design: Design, spans: Sequence[Real]
) -> tuple[CurveRate, ...]:
    """Return the rates of the `links`, each tabulated from the least to the largest l of its span.

    `spans` are (2,) each.
    """
    grids = [_grid(span[0], span[1], _CURVE_POINTS) for span in spans]
    channels = []
    for link, gain_log in zip(links, grids, strict=True):
        H_r = link.fade(link.line_of_sight_at(np.zeros(len(gain_log))))
        channels.append(np.exp(gain_log / 2)[:, None, None] * H_r)
    precoders = _curve_precoders(links, design, grids, channels)
    return tuple(
        CurveRate(link, CubicSpline.through(gain_log, design.rate(link, H, P)), gain_log, P)
        for link, gain_log, H, P in zip(links, grids, channels, precoders, strict=True)
    )


def _curve_precoders(
    links: Sequence[Link], design: Design, grids: Sequence[Real], channels: Sequence[Complex]
) -> list[Complex]:
    """Return the best precoders ((S,) m, N_t, N_t) of each link's channels along its grid of l."""
    if not design.optimal:
        return [design.precoders(link, H) for link, H in zip(links, channels, strict=True)]
    found: dict[int, Complex] = {}
    alike: dict[tuple[str, str, int], list[int]] = {}
    for j, link in enumerate(links):
        of_each_draw = design.averaged and not design.blind and link.measure == "mutual_information"
        if of_each_draw and has_few_modes(link):
            (rate,) = mode_rates([link], [grids[j][[0, -1]]])
            found[j] = rate.initial_precoders(grids[j], 0 * grids[j])
        else:
            alike.setdefault((link.measure, link.modulation, link.transmit), []).append(j)
    for group in alike.values():
        along = _along([links[j] for j in group], design, [channels[j] for j in group])
        found.update(zip(group, along, strict=True))
    return [found[j] for j in range(len(links))]


def _along(links: Sequence[Link], design: Design, channels: Sequence[Complex]) -> list[Complex]:
    """Return the best precoders ((S,) m, N_t, N_t) of each link's channels along its grid of l.

    The `links` share alphabet, measure and N_t. Scaled by sqrt(W) / sigma, their channels have the
    precoders of unit power and noise, so that the points of all are searched together.

    Every `_SEARCH_EVERY`-th point is searched from all starts, and from the results of those next
    to it. Halfway between two points that are known the search starts from between, or where they
    are of two kinds from both, until all are. The better is kept: where two kinds of precoder
    cross, the curve follows the upper one.
    """
    unit = replace(links[0], power=1.0, noise=1.0)
    H = np.concatenate(_scaled_alike(links, channels), axis=-3)
    points, transmit = channels[0].shape[-3], unit.transmit
    firsts = points * np.arange(len(links))[:, None]
    draws = () if design.blind else H.shape[:-3]
    P = np.zeros((*draws, H.shape[-3], transmit, transmit), dtype=np.complex128)
    rate = np.full(H.shape[-3], -np.inf)

    def better_from(at: Integers, start: Complex | None) -> Flags:
        """Search the points `at` from `start`, keep what is better; return where (all points,)."""
        better = np.zeros(len(rate), dtype=np.bool_)
        if len(at):
            tried = design.precoders(unit, H[..., at, :, :], start=start)
            reached = design.rate(unit, H[..., at, :, :], tried)
            for k, i in enumerate(at):
                if reached[k] > rate[i] + _SAME:
                    rate[i], better[i] = reached[k], True
                    P[..., i, :, :] = tried[..., k, :, :]
        return better

    searched = firsts + np.arange(0, points, _SEARCH_EVERY)
    better = better_from(searched.ravel(), None)
    for _ in range(2):
        pairs = searched[:, :-1].ravel(), searched[:, 1:].ravel()
        at, near = np.concatenate(pairs), np.concatenate(pairs[::-1])
        fresh = better[near]
        better = better_from(at[fresh], P[..., near[fresh], :, :])
    step = _SEARCH_EVERY
    while step > 1:
        step //= 2
        at = (firsts + np.arange(step, points - step, 2 * step)).ravel()
        below, above = P[..., at - step, :, :], P[..., at + step, :, :]
        between = _between(below, above, np.full(len(at), 0.5))
        other = np.any(~_alike(below, above).reshape(-1, len(at)), axis=0)  # of any of the draws
        starts = np.concatenate([between, above[..., other, :, :]], axis=-3)
        better_from(np.concatenate([at, at[other]]), starts)
    power = np.repeat([link.power for link in links], points)
    return np.split(P * np.sqrt(power)[:, None, None], len(links), axis=-3)


def _scaled_alike(links: Sequence[Link], channels: Sequence[Complex]) -> list[Complex]:
    """Return the channels for unit power and noise, with rows of zeros to the most antennas."""
    most = max(link.receive for link in links)
    scaled = []
    for link, H in zip(links, channels, strict=True):
        rows = [(0, 0)] * (H.ndim - 2) + [(0, most - link.receive), (0, 0)]
        scaled.append(np.pad(math.sqrt(link.power / link.noise) * H, rows))
    return scaled


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
