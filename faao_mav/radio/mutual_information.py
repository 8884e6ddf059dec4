"""The mutual information of finite-alphabet inputs, (5) and (6), by numerical averages over noise.

Only the noise within the span of H P u matters; the rest cancels in (5). Each slot is therefore
first turned into a real channel y = s + z: received points s in as few dimensions as H P leaves
them, and z ~ N(0, I) there. Then:

- next to no signal: the expansion of I in powers of the SNR;
- next to no errors: the ceiling N log2(rho), with the cutoff rate as the proof;
- one or two dimensions and few points: quadrature on a grid that is refined until it settles;
- everything else: randomly shifted lattice rules, doubled until the spread is small enough.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Complex, Real
from faao_mav.errors import InputError
from faao_mav.radio.constellation import difference_classes, difference_vector_count
from faao_mav.radio.noise_average import by_lattice, by_quadrature, real_channel, real_inputs
from faao_mav.radio.rate import cutoff_rate

Method: TypeAlias = Literal["quadrature", "monte carlo"]

_LN2 = float(np.log(2.0))
_CLASSES = 1 << 20  # difference vectors for which the cutoff rate is worth asking
_NEGLIGIBLE = 1e-6  # standard deviations of the noise: adds below 1e-12 bit
_WEAK = 1e-3  # total SNR below which two terms of the series are right to six digits
_ROUGH = 0.1  # bits that a slot among many may err: spreads of rougher ones say little
_RARE = 0.5  # gap of the cutoff rate, bits, below which errors are rare
_GRID_POINTS = 64  # input vectors up to which averaging each over a grid is the cheaper way


@dataclass(frozen=True, eq=False)
class Estimate:
    """Numerically averaged rates and how far to trust them.

    Attributes:
        value: (...) bit/s/Hz.
        error: (...) bit/s/Hz: one standard error where lattice rules were used, independent from
            slot to slot; the last change, or a bound, where the value is deterministic.
        method: "monte carlo" as soon as one slot needed lattice rules, "quadrature" otherwise.
    """

    value: Real
    error: Real
    method: Method


@dataclass(frozen=True, eq=False)
class _PerSlot:
    value: Real  # (n,)
    error: Real  # (n,)
    random: NDArray[np.bool_]  # (n,) whether the error is a standard error


def _estimate(
    H: Complex,
    P: Complex,
    modulation: str,
    noise: float,
    rng: np.random.Generator,
    *,
    tolerance: float,
    random_tolerance: float,
    pooled: bool = False,
    method: Method | None = None,
) -> _PerSlot:
    """Every slot's rate by the cheapest way that applies, or all by the way that is named."""
    if not noise > 0.0:
        raise InputError(f"the noise power must be above 0, got {noise}")
    if not tolerance > 0.0:
        raise InputError(f"the tolerance must be above 0, got {tolerance}")
    antennas = np.shape(P)[-1]
    inputs = real_inputs(modulation, antennas)
    singular, maps = real_channel(H, P, noise, real=modulation == "bpsk")
    n = len(singular)
    value, error, random = np.empty(n), np.empty(n), np.zeros(n, dtype=np.bool_)
    open_ = np.ones(n, dtype=np.bool_)

    gap = np.full(n, np.inf)
    if difference_vector_count(modulation, antennas) <= _CLASSES:
        classes = difference_classes(modulation, antennas)
        gap = np.broadcast_to(inputs.bits - cutoff_rate(H, P, classes, noise), n)

    if method is None:
        power = inputs.variance * singular**2
        total = power.sum(axis=1)
        weak = total < _WEAK
        series = 0.5 * total - 0.25 * np.sum(power**2, axis=1)
        value[weak], error[weak] = series[weak] / _LN2, total[weak] ** 3 / _LN2
        open_ &= ~weak
        sure = open_ & (gap <= 0.01 * tolerance)
        value[sure], error[sure] = inputs.bits, gap[sure]
        open_ &= ~sure

    floor = _NEGLIGIBLE * np.minimum(1.0, singular[:, :1])
    dimensions = np.maximum(1, np.sum(singular > floor, axis=1))
    for d in np.unique(dimensions[open_]):
        slots = np.flatnonzero(open_ & (dimensions == d))
        reduced = np.ascontiguousarray(maps[slots, :, :d])
        few = d <= 2 and len(inputs.points) <= _GRID_POINTS
        if method == "quadrature" or (method is None and few):
            value[slots], error[slots] = by_quadrature(reduced, inputs, tolerance)
        else:
            rare = gap[slots] < _RARE
            for kind in (False, True):
                chosen = slots[rare == kind]
                if len(chosen):
                    value[chosen], error[chosen] = by_lattice(
                        reduced[rare == kind],
                        inputs,
                        random_tolerance,
                        rng,
                        rare=kind,
                        pooled=pooled,
                    )
            random[slots] = True
    return _PerSlot(value, error, random)


def mutual_information(
    H: Complex,
    P: Complex,
    modulation: str,
    noise: float,
    *,
    rng: np.random.Generator,
    tolerance: float = 1e-3,
) -> Estimate:
    """Return the mutual information of a link in every slot, (5) or (6).

    I = N log2(rho) - rho^-N Σ_m E log2 Σ_k exp(-(||H P u_mk + n||² - ||n||²) / σ²) with noise
    n ~ CN(0, σ² I).

    Args:
        H: (n, N_r, N_t) channels.
        P: (n, N_t, N_t) precoders.
        modulation: one of ``MODULATIONS``.
        noise: σ², W.
        rng: source of the random shifts; not touched by slots that need none.
        tolerance: largest error wanted in each slot, bit/s/Hz. The effort per slot is limited (a
            million points): ``error`` says what was reached.

    Returns:
        Values and errors (n,).

    Raises:
        InputError: unknown modulation, more than 65,536 input vectors, or a noise power or
            tolerance not above 0.

    >>> one = np.ones((1, 1, 1))
    >>> estimate = mutual_information(one, one, "bpsk", 1.0, rng=np.random.default_rng(1))
    >>> estimate.value.round(4), estimate.method
    (array([0.7215]), 'quadrature')
    """
    slots = _estimate(H, P, modulation, noise, rng, tolerance=tolerance, random_tolerance=tolerance)
    method: Method = "monte carlo" if np.any(slots.random) else "quadrature"
    return Estimate(slots.value, slots.error, method)


def mean_mutual_information(
    H: Complex,
    P: Complex,
    modulation: str,
    noise: float,
    *,
    rng: np.random.Generator,
    tolerance: float = 1e-3,
) -> tuple[float, float]:
    """Return the mean of (5) or (6) over the slots, and its error, bit/s/Hz.

    Standard errors are independent from slot to slot, so each slot may err √n times as much as
    their mean; deterministic errors add up and get a quarter of the tolerance.

    Args:
        H: (n, N_r, N_t) channels.
        P: (n, N_t, N_t) precoders.
        modulation: one of ``MODULATIONS``.
        noise: σ², W.
        rng: source of the random shifts.
        tolerance: largest error wanted in the mean, bit/s/Hz.

    Raises:
        InputError: as ``mutual_information``.

    >>> one = np.ones((3, 1, 1))
    >>> value, error = mean_mutual_information(one, one, "qpsk", 1.0, rng=np.random.default_rng(1))
    >>> round(value, 3), error < 1e-3
    (0.972, True)
    """
    n = len(H)
    slots = _estimate(
        H,
        P,
        modulation,
        noise,
        rng,
        tolerance=0.25 * tolerance,
        random_tolerance=min(0.75 * tolerance * float(np.sqrt(n)), _ROUGH),
        pooled=True,
    )
    spread = float(np.sqrt(np.sum(slots.error[slots.random] ** 2)))
    bounds = float(np.sum(slots.error[~slots.random]))
    return float(np.mean(slots.value)), (spread + bounds) / n
