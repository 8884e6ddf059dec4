"""The best rate of a link with one or two modes, for fading known slot by slot.

The best rate depends on H through its singular values λ_1 >= λ_2 alone. It is therefore one
function f(a, κ) of a = ln(W λ_1² / σ²) and κ = λ_2 / λ_1 for all slots: the best precoders are
searched once on a grid of a and κ, and a bicubic spline interpolates their rates. With
H = sqrt(gain) H_r, a = l + ln(W λ_1² / σ²) of H_r, and κ does not depend on l.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from faao_mav.arrays import Complex, Integers, Real
from faao_mav.optimizer.problem import Link
from faao_mav.optimizer.rates import DirectionPartials, RatePartials
from faao_mav.optimizer.rates.spline import BicubicSpline, GridPosition
from faao_mav.radio.best_precoder import best_precoders, has_closed_form
from faao_mav.radio.rate import Measure, draw_rates

# Chosen; what a change costs is not measured.
_SPACING = 0.125  # spacing of the grid of a, 0.54 dB: of the cutoff rate
_INFORMATION_SPACING = 0.25  # that of the mutual information, whose points take ten times as long
_WHOLE = 2  # the grid of a ends at multiples of this, so that the links of a plan share a table
_MARGIN = 0.1  # margin of the grid of a beyond the values at the sampled directions
_RATIOS, _INFORMATION_RATIOS = 17, 9  # grid points of κ, evenly from 0 to 1
_SEARCH_EVERY = (8, 4)  # steps of a and of κ between points that are searched from all starts
_STEP = 1e-3  # step of u in the central differences of a and κ, whose errors are about 1e-6
_DIRECTIONS = 33  # directions u at which the range of a is sampled


@dataclass(frozen=True, slots=True, eq=False)
class ModeTable:
    """The best rate f(a, κ).

    `gains` (m,) and `ratios` (c,) are the grids of a and κ, `Q` (m, c, N_t, N_t) the best precoders
    there for unit power, in the basis of the right singular vectors. `exact` tells that they have a
    closed form; the only error of the rate is then that of the spline.
    """

    spline: BicubicSpline
    gains: Real
    ratios: Real
    Q: Complex
    exact: bool


@dataclass(frozen=True, slots=True, eq=False)
class ModeRate:
    """The rate that counts at the best precoders, for links with one or two modes.

    `fixed` is the result of `_located` for a link whose H_r does not depend on u, else None.
    """

    link: Link
    table: ModeTable
    fixed: tuple[Real, GridPosition] | None

    @property
    def exact(self) -> bool:
        """Whether the best precoders have a closed form."""
        return self.table.exact

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate R of every slot, bits (..., n)."""
        strength, ratio = self.fixed or _located(self.table, *_modes(self.link, cosine))
        return self.table.spline.value(gain_log + strength, ratio)

    def partials(self, gain_log: Real, cosine: Real) -> RatePartials:
        """Return the rate and its derivatives by l and u, bits (..., n)."""
        if self.fixed:
            strength, ratio = self.fixed
            return RatePartials(*self.table.spline.by_x(gain_log + strength, ratio))
        here, up, down = (_modes(self.link, cosine + h) for h in (0, _STEP, -_STEP))
        a_u, k_u = ((x - y) / (2 * _STEP) for x, y in zip(up, down, strict=True))
        a_uu, k_uu = ((x - 2 * m + y) / _STEP**2 for x, m, y in zip(up, here, down, strict=True))
        strength, ratio = _located(self.table, *here)
        value, by_a, by_k, by_aa, by_ak, by_kk = self.table.spline.by_both(
            gain_log + strength, ratio
        )
        direction = DirectionPartials(
            by_u=by_a * a_u + by_k * k_u,
            by_lu=by_aa * a_u + by_ak * k_u,
            by_uu=by_aa * a_u**2
            + 2 * by_ak * a_u * k_u
            + by_kk * k_u**2
            + by_a * a_uu
            + by_k * k_uu,
        )
        return RatePartials(value, by_a, by_aa, direction)

    def initial_precoders(self, gain_log: Real, cosine: Real) -> Complex:
        """Return precoders ((S,) n, N_t, N_t) close to the best at l and u (n,).

        They are those of the nearest grid points, in the basis of each slot's singular vectors.
        """
        strength, ratio = _modes(self.link, cosine)
        i = _nearest(self.table.gains, gain_log + strength)
        j = _nearest(self.table.ratios, ratio)
        H_r = self.link.fade(self.link.line_of_sight_at(cosine))
        _, _, Vh = np.linalg.svd(H_r)
        return np.asarray(Vh.conj().mT @ self.table.Q[i, j]) * math.sqrt(self.link.power)


def has_few_modes(link: Link) -> bool:
    """Return whether `link` has at most two modes, so that `ModeRate` holds for it."""
    return min(link.receive, link.transmit) <= 2


def mode_rates(links: Sequence[Link], spans: Sequence[Real]) -> tuple[ModeRate, ...]:
    """Return the best rates of `links`, whose draws are known, each for the l of its span (2,).

    Links of one alphabet and one number of modes share a table, if their strengths overlap.
    """
    kinds = [
        (link.measure, link.modulation, link.transmit, min(2, link.receive, link.transmit))
        for link in links
    ]
    ends = [_ends(link, *span) for link, span in zip(links, spans, strict=True)]
    if len(set(kinds)) == 1 and max(low for low, _ in ends) <= min(high for _, high in ends):
        ends = [(min(low for low, _ in ends), max(high for _, high in ends))] * len(links)
    rates = []
    for link, kind, reach in zip(links, kinds, ends, strict=True):
        table, fixed = _table(*kind, *reach), None
        if not link.follows_position:
            fixed = _located(table, *_modes(link, np.zeros(_slots(link))))
        rates.append(ModeRate(link, table, fixed))
    return tuple(rates)


def _slots(link: Link) -> int:
    return 1 if link.nlos is None else len(link.nlos)


def _ends(link: Link, least: float, most: float) -> tuple[int, int]:
    """Return the least and the largest a of `link` from l = `least` to l = `most`, rounded out."""
    directions = np.linspace(-1, 1, _DIRECTIONS) if link.follows_position else np.zeros(1)
    strengths = [_modes(link, np.full(_slots(link), u))[0] for u in directions]
    low = least + min(s.min() for s in strengths) - _MARGIN
    high = most + max(s.max() for s in strengths) + _MARGIN
    return math.floor(low / _WHOLE) * _WHOLE, math.ceil(high / _WHOLE) * _WHOLE


def _located(table: ModeTable, strength: Real, ratio: Real) -> tuple[Real, GridPosition]:
    """Return a - l as it is, and κ by its position on the grid of the table."""
    return strength, table.spline.locate(ratio)


@lru_cache(maxsize=8)
def _table(
    measure: Measure, modulation: str, antennas: int, modes: int, low: int, high: int
) -> ModeTable:
    """Return the table for an alphabet and a number of modes, from a = `low` to a = `high`."""
    cutoff = measure == "cutoff"
    spacing = _SPACING if cutoff else _INFORMATION_SPACING
    gains = np.linspace(low, high, round((high - low) / spacing) + 1)
    ratios = np.linspace(0, 1, _RATIOS if cutoff else _INFORMATION_RATIOS)
    searched = ratios if modes == 2 else ratios[:1]  # of one mode κ is 0
    H = np.zeros((len(gains), len(searched), modes, antennas), dtype=np.complex128)
    H[..., 0, 0] = np.exp(gains / 2)[:, None]
    if modes == 2:
        H[..., 1, 1] = np.exp(gains / 2)[:, None] * searched
    rate, Q, exact = _search(measure, modulation, H)
    alike = len(ratios) // len(searched)
    spline = BicubicSpline.through(gains, ratios, np.repeat(rate, alike, axis=1))
    return ModeTable(spline, gains, ratios, np.repeat(Q, alike, axis=1), exact)


def _search(measure: Measure, modulation: str, H: Complex) -> tuple[Real, Complex, bool]:
    """Return best rates (m, c) and precoders (m, c, N, N) for H (m, c, modes, N); whether exact.

    Without a closed form, every `_SEARCH_EVERY`-th point is searched from all starts. All points
    are then searched from the four of these around them, and keep the best.
    """

    def searched(H: Complex, start: Complex | None = None) -> tuple[Real, Complex]:
        draws = H[..., None, :, :]
        P = best_precoders(draws, 1.0, modulation, 1.0, measure=measure, start=start)
        return draw_rates(measure, draws, P[..., None, :, :], modulation, 1.0)[..., 0], P

    if has_closed_form(modulation, H.shape[-1]):
        return *searched(H), True
    every_a, every_k = _SEARCH_EVERY
    _, coarse = searched(H[::every_a, ::every_k])
    i, j = np.arange(H.shape[0]) // every_a, np.arange(H.shape[1]) // every_k
    rate, Q = np.full(H.shape[:2], -np.inf), np.zeros((*H.shape[:2], *coarse.shape[2:]), complex)
    for up in (0, 1):
        for right in range(min(2, coarse.shape[1])):
            near = coarse[np.minimum(i + up, coarse.shape[0] - 1)]
            near = near[:, np.minimum(j + right, coarse.shape[1] - 1)]
            reached, P = searched(H, near)
            better = reached > rate
            rate = np.where(better, reached, rate)
            Q = np.where(better[..., None, None], P, Q)
    return rate, Q, False


def _modes(link: Link, cosine: Real) -> tuple[Real, Real]:
    """Return a - l = ln(W λ_1² / σ²) and κ = λ_2 / λ_1 of H_r, (..., n), at u (..., n)."""
    snr = math.log(link.power / link.noise)
    H_r = link.fade(link.line_of_sight_at(cosine))
    if H_r.shape[-2] > H_r.shape[-1]:
        H_r = np.swapaxes(H_r, -1, -2)
    trace = np.sum(H_r.real**2 + H_r.imag**2, axis=(-2, -1))
    if H_r.shape[-2] == 1:
        return np.log(trace) + snr, np.zeros_like(trace)
    gram = H_r @ H_r.conj().mT
    apart = np.hypot((gram[..., 0, 0] - gram[..., 1, 1]).real, 2 * np.abs(gram[..., 0, 1]))
    ratio = np.sqrt(np.maximum(trace - apart, 0) / (trace + apart))
    return np.log((trace + apart) / 2) + snr, ratio


def _nearest(grid: Real, x: Real) -> Integers:
    """Return the indices (...) of the grid points nearest to x (...)."""
    index = np.rint((x - grid[0]) / (grid[1] - grid[0])).astype(np.intp)
    return np.asarray(np.clip(index, 0, len(grid) - 1))
