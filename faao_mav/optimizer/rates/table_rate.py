"""Rates from tables: a spline of (x, y), x = l + shift, that does not know where stations are.

With H = e^(l/2) H_r, power W and noise σ² the rate is that of e^(x/2) H(y) at unit power and noise,
x = l + ln(W / σ²) + ..., for three kinds of links:

- ``curve``: without known draws the best rate depends on the distance alone: the distribution of
  the fading does not change when the line of sight is rotated, and precoders undo the rotation;
- ``surface``: a classical scheme does not rotate its streams with the arrays: its rate depends on
  the direction u too, y = u;
- ``modes``: with a draw known for every slot the best rate depends on the singular values
  λ_1 >= λ_2 of H_r alone. For two modes at most x = l + ln(W λ_1² / σ²) and y = κ = λ_2 / λ_1, and
  all slots share one table.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from faao_mav.arrays import Complex, Flags, Integers, Real
from faao_mav.optimizer.design import Design, Link
from faao_mav.optimizer.interior.rewards import StageValues
from faao_mav.radio.gain import PER_DB
from faao_mav.radio.spline import Spline

Kind: TypeAlias = Literal["curve", "surface", "modes"]

_SPACING = {"cutoff": 0.125, "mutual_information": 0.25}
"""Spacing of the grid of x. Chosen so that tables differ from exact cutoff rates by less than 2e-4
bit (test_rate_models.py); points of the mutual information take ten times as long."""

_WHOLE = 1.0
"""The grid of x ends at multiples of this, so that plans and links share tables, and at these
points precoders are searched from all starts, between from those next to them. Measured beside 2:
the mutual information of known draws rises by 0.1 %, other rates by up to 0.02 %."""

_DIRECTIONS, _RATIOS = 65, {"cutoff": 17, "mutual_information": 9}
"""Grid points of u, evenly from -1 to 1, and of κ, evenly from 0 to 1. Chosen."""

_ALIKE = 0.3
"""The distance, in their size, up to which precoders of neighbouring points are of one kind: those
between serve as starts. Chosen."""

_PER_RISE = 12
"""Spacings of the grid of x over which a step of a radio's own rates rises, at least. Chosen."""

_SAME = 1e-6
"""Gain, bit, below which a precoder found from another start is the same, in another form. Those of
a kind then stay in one form along x. Chosen."""

STEP = 1e-3
"""Step of l and u in central differences: derivatives of a few bits, or of x and y, err by 1e-5."""

_KEPT = 8
"""Tables that are kept, the last ones. Chosen."""


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """The rate over x and y, and for the best rate the precoders ((S,) m, k, N_t, N_t), P.

    P are those of the grid (m, k) for unit power.
    """

    spline: Spline
    P: Complex


@dataclass(frozen=True, slots=True, eq=False)
class TableRate:
    """The rate of a link from a table."""

    link: Link
    kind: Kind
    table: Table

    def value(self, gain_log: Real, cosine: Real) -> Real:
        """Return the rate R of every slot, bits (..., n)."""
        shift, y = _shifted(self.link, self.kind, cosine)
        return np.maximum(0.0, self.table.spline.value(gain_log + shift, y))

    def partials(self, gain_log: Real, cosine: Real) -> StageValues:
        """Return the rate and its derivatives by l and u: see `RateModel`."""
        here = _shifted(self.link, self.kind, cosine)
        if self.kind == "curve" or not self.link.follows_position:
            value, by_l, by_ll = self.table.spline.by_x(gain_log + here[0], here[1])
            return StageValues(np.maximum(0.0, value), by_l[None], by_ll[None])
        up, down = (_shifted(self.link, self.kind, cosine + h) for h in (STEP, -STEP))
        x_u, y_u = ((a - b) / (2 * STEP) for a, b in zip(up, down, strict=True))
        x_uu, y_uu = ((a - 2 * m + b) / STEP**2 for a, m, b in zip(up, here, down, strict=True))
        value, by_x, by_y, by_xx, by_xy, by_yy = self.table.spline.by_both(
            gain_log + here[0], here[1]
        )
        bent = by_xx * x_u**2 + 2 * by_xy * x_u * y_u + by_yy * y_u**2
        return StageValues(
            np.maximum(0.0, value),
            np.stack([by_x, by_x * x_u + by_y * y_u]),
            np.stack([by_xx, by_xx * x_u + by_xy * y_u, bent + by_x * x_uu + by_y * y_uu]),
        )

    def initial_precoders(self, gain_log: Real, cosine: Real) -> Complex:
        """Return precoders ((S,) n, N_t, N_t) close to the best at l and u (n,).

        They are those between the grid points about x, or of the nearest where these are of two
        kinds, turned into the frame of each slot: that of the singular vectors, or of the line of
        sight.
        """
        spline, P = self.table.spline, self.table.P
        shift, y = _shifted(self.link, self.kind, cosine)
        last = len(spline.x) - 1
        place = np.clip((gain_log + shift - spline.x[0]) / (spline.x[1] - spline.x[0]), 0, last)
        below = np.minimum(place.astype(np.intp), last - 1)
        column = np.rint(y * (len(spline.y) - 1)).astype(np.intp)
        near = _between(P[..., below, column, :, :], P[..., below + 1, column, :, :], place - below)
        los = self.link.line_of_sight_at(cosine)
        if self.kind == "modes":
            near = np.linalg.svd(self.link.fade(los))[2].conj().mT @ near
        else:
            near = np.conj(los[:, 0])[:, :, None] * near  # D_r is 1 at the first antenna
        return np.asarray(math.sqrt(self.link.power) * near)


def kind_of(link: Link, design: Design) -> Kind | None:
    """Return the kind of table that the rate of `link` under `design` has, if any."""
    if link.nlos is not None and not design.averaged:
        return "modes" if design.optimal and _few_modes(link) else None
    rotated = design.optimal or (design.gaussian and design.scheme == "faao" and not design.own)
    return "curve" if rotated or not link.follows_position else "surface"


def _few_modes(link: Link) -> bool:
    return link.steps is not None or min(link.receive, link.transmit) <= 2


def table_rates(links: Sequence[tuple[Link, Real]], design: Design) -> tuple[TableRate, ...]:
    """Return the rates of `links` that have a `kind_of` table, each over a span of l.

    Links of known draws share a table if they have one alphabet and one number of modes.
    """
    kinds, ranges = [], []
    for link, span in links:
        kind = kind_of(link, design)
        assert kind is not None
        kinds.append(kind)
        directions = np.linspace(-1, 1, _DIRECTIONS) if link.follows_position else np.zeros(1)
        slots = 1 if link.nlos is None else link.nlos.shape[-3]
        shifts = np.array([_shifted(link, kind, np.full(slots, u))[0] for u in directions])
        ranges.append((float(span.min() + shifts.min()), float(span.max() + shifts.max())))
    if kinds and all(kind == "modes" for kind in kinds):
        ranges = [(min(low for low, _ in ranges), max(high for _, high in ranges))] * len(ranges)
    return tuple(
        TableRate(link, kind, _table(link, kind, design, *ends))
        for (link, _), kind, ends in zip(links, kinds, ranges, strict=True)
    )


def _shifted(link: Link, kind: Kind, cosine: Real) -> tuple[Real, Real]:
    """Return x - l and y (..., n) at u (..., n)."""
    snr = math.log(link.power / link.noise)
    if kind != "modes":
        return np.full(cosine.shape, snr), cosine if kind == "surface" else np.zeros(cosine.shape)
    H_r = link.fade(link.line_of_sight_at(cosine))
    if link.steps is not None or min(link.receive, link.transmit) == 1:
        mode = np.linalg.norm(H_r, 2, axis=(-2, -1))
        return 2 * np.log(mode) + snr, np.zeros_like(mode)
    if H_r.shape[-2] > H_r.shape[-1]:
        H_r = np.swapaxes(H_r, -1, -2)
    trace = np.sum(H_r.real**2 + H_r.imag**2, axis=(-2, -1))
    gram = H_r @ H_r.conj().mT
    apart = np.hypot((gram[..., 0, 0] - gram[..., 1, 1]).real, 2 * np.abs(gram[..., 0, 1]))
    ratio = np.sqrt(np.maximum(trace - apart, 0) / (trace + apart))
    return np.log((trace + apart) / 2) + snr, ratio


_tables: dict[tuple[object, ...], Table] = {}


def _table(link: Link, kind: Kind, design: Design, low: float, high: float) -> Table:
    """Return the table of `link` that covers x from `low` to `high`; one made before if it is kept.

    It depends on powers, noises and places by this range only.
    """
    every = round(_WHOLE / _SPACING[link.measure])
    if link.steps is not None:
        every = max(every, math.ceil(_WHOLE * _PER_RISE / (PER_DB * link.steps.width)))
    first = math.floor(low / _WHOLE)
    steps = max(1, math.ceil(high / _WHOLE) - first)  # one gain alone may be a whole number
    x = _WHOLE * np.linspace(first, first + steps, steps * every + 1)
    unit = replace(link, power=1.0, noise=1.0)
    y = np.zeros(1)
    if kind == "modes":
        unit, design = replace(unit, nlos=None), replace(design, averaged=False, blind=False)
        modes = min(link.receive, link.transmit)
        if modes == 2 and link.steps is None:
            y = np.linspace(0, 1, _RATIOS[link.measure])
        H = np.zeros((len(y), modes, link.transmit), dtype=np.complex128)
        H[:, 0, 0] = 1.0
        H[:, 1:, 1:2] = y[:, None, None]
    else:
        if kind == "surface":
            y = np.linspace(-1, 1, _DIRECTIONS)
        H = link.fade(link.line_of_sight_at(y))
    key = (design, link.measure, link.modulation, link.steps, x[0], x[-1], H.shape, H.tobytes())
    if key not in _tables:
        while len(_tables) >= _KEPT:
            del _tables[next(iter(_tables))]
        _tables[key] = _made(unit, design, x, y, H)
    return _tables[key]


def _made(unit: Link, design: Design, x: Real, y: Real, H: Complex) -> Table:
    """Return the table of the channels H ((S,) k, N_r, N_t) of each y, of unit power and noise."""
    seen = design.optimal and design.averaged and not design.blind
    if seen and _few_modes(unit):  # the best rates of all draws are in one table
        (of_each,) = table_rates([(unit, x[[0, -1]])], replace(design, averaged=False))
        mean = of_each.value(x, 0 * x).mean(axis=0)
        P = of_each.initial_precoders(x, 0 * x)[..., None, :, :]
        return Table(Spline.through(x, y, mean[:, None]), P)
    scaled = np.exp(x / 2)[:, None, None, None] * H[..., None, :, :, :]
    flat = scaled.reshape(*H.shape[:-3], len(x) * len(y), *H.shape[-2:])
    closed = unit.steps is not None or (unit.closed_form and not design.blind)
    if design.optimal and not closed:
        P = _searched(unit, design, flat, len(y))
    else:
        P = design.precoders(unit, flat)
    rate = design.rate(unit, flat, P).reshape(len(x), len(y))
    return Table(Spline.through(x, y, rate), P.reshape(*P.shape[:-3], *rate.shape, *P.shape[-2:]))


def _searched(unit: Link, design: Design, H: Complex, columns: int) -> Complex:
    """Return the best precoders ((S,) m k, N_t, N_t) of channels H along x, `columns` = k each.

    Whole x are searched from all starts, and from the results of those next to them. Halfway
    between two points that are known the search starts from between, or where they are of two kinds
    from both, until all are. The better is kept: where two kinds of precoder cross, the rate
    follows the upper one.
    """
    points, N = H.shape[-3] // columns, unit.transmit
    draws = () if design.blind else H.shape[:-3]
    P = np.zeros((*draws, points * columns, N, N), dtype=np.complex128)
    rate = np.full(points * columns, -np.inf)

    def improve(at: Integers, start: Complex | None) -> None:
        """Search the points `at` from `start`, and keep what is better."""
        if len(at):
            tried = design.precoders(unit, H[..., at, :, :], start=start)
            reached = design.rate(unit, H[..., at, :, :], tried)
            better = reached > rate[at] + _SAME
            rate[at[better]] = reached[better]
            P[..., at[better], :, :] = tried[..., better, :, :]

    index = np.arange(points * columns).reshape(points, columns)
    step = round(_WHOLE / _SPACING[unit.measure])
    improve(index[::step].ravel(), None)
    lower, upper = index[:-step:step].ravel(), index[step::step].ravel()
    for _ in range(2):
        improve(upper, P[..., lower, :, :])
        improve(lower, P[..., upper, :, :])
    while step > 1:
        at = index[step // 2 :: step].ravel()
        below, above = (P[..., at + way * step // 2 * columns, :, :] for way in (-1, 1))
        improve(at, _between(below, above, np.full(len(at), 0.5)))
        other = np.any(~_alike(below, above).reshape(-1, len(at)), axis=0)  # of any of the draws
        improve(at[other], above[..., other, :, :])
        step //= 2
    return P


def _alike(here: Complex, there: Complex) -> Flags:
    """Return whether precoders (..., N_t, N_t) are of one kind, so that those between are near."""
    apart = np.linalg.norm(there - here, axis=(-2, -1))
    return np.asarray(apart < _ALIKE * np.linalg.norm(here, axis=(-2, -1)))


def _between(here: Complex, there: Complex, fraction: Real) -> Complex:
    """Return precoders at a `fraction` (n,) of the way, the nearest of two that are not alike."""
    part = np.where(_alike(here, there), fraction, np.rint(fraction))[..., None, None]
    return np.asarray(here + part * (there - here))
