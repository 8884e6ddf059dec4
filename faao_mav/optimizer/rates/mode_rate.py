"""The best rate of a link with one or two modes, for fading known slot by slot.

The best rate depends on H through its singular values alone. With two of them it is one function of
two numbers for all slots and both links: searched once on a grid, then read off, the same at every
visit.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.problem import Link
from faao_mav.optimizer.rates.bicubic import Bicubic, Rows
from faao_mav.optimizer.rates.place import Partials, Turning
from faao_mav.radio.best_precoder import best_precoders

_SPACING = 0.125  # of a
_SNAP = 2  # ends of the grid of a, so that links of one plan share it
_RATIOS = 17
_SEARCH_EVERY = (8, 4)
_STEP = 1e-3  # of u, for the derivatives of singular values
_DIRECTIONS = 33


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """The best rate over a = ln(W lambda_1² gain / sigma²) and kappa = lambda_2 / lambda_1.

    `gains` (m,) and `ratios` (c,) are the grid, `Q` (m, c, N_t, N_t) the best precoders there for
    unit power, in the basis of the right singular vectors; `exact` says that they are known in
    closed form, so that only the spline errs.
    """

    spline: Bicubic
    gains: Real
    ratios: Real
    Q: Complex
    exact: bool


@dataclass(frozen=True, slots=True, eq=False)
class ModeRate:
    """The cutoff rate (7), (8) at the best precoders, for links with one or two modes."""

    link: Link
    table: Table
    fixed: tuple[Real, Rows] | None
    """What `_modes` finds, as the table is asked, for links on which it is the same everywhere."""

    @property
    def exact(self) -> bool:
        """Whether the best precoders are known in closed form."""
        return self.table.exact

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate of every slot, bits (..., n)."""
        strength, rows = self.fixed or _asked(self.table, *_modes(self.link, cosine))
        return self.table.spline.value(gain_log + strength, rows)

    def partials(self, gain_log: Real, cosine: Real) -> Partials:
        """Return the rate and its derivatives by l and u."""
        if self.fixed:
            strength, rows = self.fixed
            return Partials(*self.table.spline.by_x(gain_log + strength, rows))
        here, up, down = (_modes(self.link, cosine + h) for h in (0, _STEP, -_STEP))
        a_u, k_u = ((x - y) / (2 * _STEP) for x, y in zip(up, down, strict=True))
        a_uu, k_uu = ((x - 2 * m + y) / _STEP**2 for x, m, y in zip(up, here, down, strict=True))
        strength, rows = _asked(self.table, *here)
        value, by_a, by_k, by_aa, by_ak, by_kk = self.table.spline.by_both(
            gain_log + strength, rows
        )
        turning = Turning(
            by_u=by_a * a_u + by_k * k_u,
            by_lu=by_aa * a_u + by_ak * k_u,
            by_uu=by_aa * a_u**2
            + 2 * by_ak * a_u * k_u
            + by_kk * k_u**2
            + by_a * a_uu
            + by_k * k_uu,
        )
        return Partials(value, by_a, by_aa, turning)

    def start(self, gain_log: Real, cosine: Real) -> Complex:
        """Return nearly the best precoders (n, N_t, N_t): the grid's, in each slot's own basis."""
        strength, ratio = _modes(self.link, cosine)
        i = _nearest(self.table.gains, gain_log + strength)
        j = _nearest(self.table.ratios, ratio)
        H_r = self.link.fade(self.link.line_of_sight_at(cosine))
        _, _, Vh = np.linalg.svd(H_r)
        return np.asarray(np.conj(np.swapaxes(Vh, -1, -2)) @ self.table.Q[i, j])


def has_few_modes(link: Link) -> bool:
    """Return whether `ModeRate` can describe `link`."""
    return min(link.receive, link.transmit) <= 2


def mode_rate(link: Link, least: float, most: float) -> ModeRate:
    """Search the best rates of `link` between two logarithms of the path gain."""
    directions = np.linspace(-1, 1, _DIRECTIONS) if link.follows_position else np.zeros(1)
    slots = 1 if link.nlos is None else len(link.nlos)
    strengths = [_modes(link, np.full(slots, u))[0] for u in directions]
    low = least + min(s.min() for s in strengths) - 0.1
    high = most + max(s.max() for s in strengths) + 0.1
    snapped = (math.floor(low / _SNAP) * _SNAP, math.ceil(high / _SNAP) * _SNAP)
    modes = min(2, link.receive, link.transmit)
    table = _table(link.modulation, link.transmit, modes, *snapped)
    if link.follows_position:
        return ModeRate(link, table, None)
    return ModeRate(link, table, _asked(table, *_modes(link, np.zeros(slots))))


def _asked(table: Table, strength: Real, ratio: Real) -> tuple[Real, Rows]:
    return strength, table.spline.rows(ratio)


@lru_cache(maxsize=8)
def _table(modulation: str, antennas: int, modes: int, low: int, high: int) -> Table:
    """Search the grid: every point is reached from the searched points around it, the best kept."""
    gains = np.linspace(low, high, round((high - low) / _SPACING) + 1)
    ratios = np.linspace(0, 1, _RATIOS)
    H = np.zeros((len(gains), len(ratios), modes, antennas), dtype=np.complex128)
    H[..., 0, 0] = np.exp(gains / 2)[:, None]
    if modes == 2:
        H[..., 1, 1] = np.exp(gains / 2)[:, None] * ratios
    rate, Q, exact = _search(modulation, H)
    return Table(Bicubic.through(gains, ratios, rate), gains, ratios, Q, exact)


def _search(modulation: str, H: Complex) -> tuple[Real, Complex, bool]:
    exact = best_precoders(H[:1, :1], 1.0, modulation, 1.0).exact
    if exact:
        found = best_precoders(H, 1.0, modulation, 1.0)
        return found.rate, found.P, True
    every_a, every_k = _SEARCH_EVERY
    coarse = best_precoders(H[::every_a, ::every_k], 1.0, modulation, 1.0).P
    i, j = np.arange(H.shape[0]) // every_a, np.arange(H.shape[1]) // every_k
    rate, Q = np.full(H.shape[:2], -np.inf), np.zeros((*H.shape[:2], *coarse.shape[2:]), complex)
    for up in (0, 1):
        for right in (0, 1):
            near = coarse[np.minimum(i + up, coarse.shape[0] - 1)]
            near = near[:, np.minimum(j + right, coarse.shape[1] - 1)]
            found = best_precoders(H, 1.0, modulation, 1.0, start=near)
            better = found.rate > rate
            rate = np.where(better, found.rate, rate)
            Q = np.where(better[..., None, None], found.P, Q)
    return rate, Q, False


def _modes(link: Link, cosine: Real) -> tuple[Real, Real]:
    """Return ln(W lambda_1² / sigma²) and kappa of H_r (..., n) at direction cosines u (..., n)."""
    snr = math.log(link.power / link.noise)
    H_r = link.fade(link.line_of_sight_at(cosine))
    if H_r.shape[-2] > H_r.shape[-1]:
        H_r = np.swapaxes(H_r, -1, -2)
    trace = np.sum(H_r.real**2 + H_r.imag**2, axis=(-2, -1))
    if H_r.shape[-2] == 1:
        return np.log(trace) + snr, np.zeros_like(trace)
    gram = H_r @ np.conj(np.swapaxes(H_r, -1, -2))
    apart = np.hypot((gram[..., 0, 0] - gram[..., 1, 1]).real, 2 * np.abs(gram[..., 0, 1]))
    ratio = np.sqrt(np.maximum(trace - apart, 0) / (trace + apart))
    return np.log((trace + apart) / 2) + snr, ratio


def _nearest(grid: Real, x: Real) -> Any:
    index = np.rint((x - grid[0]) / (grid[1] - grid[0])).astype(np.intp)
    return np.clip(index, 0, len(grid) - 1)
