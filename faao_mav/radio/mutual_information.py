"""The mutual information of finite-alphabet inputs, (5) and (6), by numerical averages over noise.

Only the noise within the span of H P u matters; the rest cancels in (5). Each slot is therefore
first turned into a real channel y = s + z: received points s in as few dimensions as H P leaves
them, and z ~ N(0, I) there. Then:

- next to no signal: the expansion of I in powers of the SNR;
- next to no errors: the ceiling N log2(rho), with the cutoff rate as the proof;
- one symbol of a square alphabet: twice the information of one of its parts, which is real;
- one or two dimensions and few points: quadrature on a grid that is refined until it settles;
- everything else: randomly shifted lattice rules, doubled until the spread is small enough.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Flags, Real, RealOrComplex
from faao_mav.errors import InputError
from faao_mav.radio.constellation import difference_classes, difference_vector_count
from faao_mav.radio.noise_average import by_lattice, by_quadrature
from faao_mav.radio.rate import cutoff_rate
from faao_mav.radio.real_channel import real_channel, real_inputs

_LN2 = float(np.log(2.0))

# Chosen, unless another reason is given.
_MOST_DIFFERENCES = 1 << 20  # difference vectors up to which the cutoff rate proves the ceiling
_NEGLIGIBLE = 1e-6  # amplitude of a dimension, noise deviations, that adds less than 1e-12 bit
_WEAK = 1e-3  # total SNR below which two terms of the series in the SNR are right to six digits
_ROUGH = 0.1  # largest standard error of one slot among many, bits
_RARE = 0.5  # gap of the cutoff rate to its ceiling, bits, below which errors count as rare
# Input vectors up to which a grid for each is quicker than lattices: for single slots, and where
# only the mean over many counts (with 64 vectors 1.1 s and 0.15 s for two links of 200 slots)
_GRID_INPUTS, _POOLED_GRID_INPUTS = 64, 16


@dataclass(frozen=True, eq=False)
class Estimate:
    """Numerically averaged rates and how far to trust them.

    Attributes:
        value: (n,) bit/s/Hz.
        error: (n,) bit/s/Hz: one standard error where ``random``, independent from slot to slot;
            elsewhere the last change of the quadrature, or a bound.
        random: (n,) whether random lattice rules were used.
    """

    value: Real
    error: Real
    random: Flags

    @property
    def mean_error(self) -> float:
        """The error of the mean of all values: random ones partly cancel, the others add up."""
        spread = float(np.sqrt(np.sum(self.error[self.random] ** 2)))
        return (spread + float(np.sum(self.error[~self.random]))) / len(self.value)


def _estimate(
    H: RealOrComplex,
    P: RealOrComplex,
    modulation: str,
    noise: float,
    rng: np.random.Generator,
    *,
    tolerance: float,
    random_tolerance: float,
    pooled: bool = False,
) -> Estimate:
    """Return every slot's rate by the cheapest way that applies."""
    if not noise > 0.0:
        raise InputError(f"the noise power must be above 0, got {noise}")
    if not tolerance > 0.0:
        raise InputError(f"the tolerance must be above 0, got {tolerance}")
    antennas = np.shape(P)[-1]
    inputs = real_inputs(modulation, antennas)
    singular, maps = real_channel(H, P, noise, real=modulation == "bpsk")
    n = len(singular)
    value, error, random = np.empty(n), np.empty(n), np.zeros(n, dtype=np.bool_)

    gap = np.full(n, np.inf)
    if difference_vector_count(modulation, antennas) <= _MOST_DIFFERENCES:
        classes = difference_classes(modulation, antennas)
        gap = np.broadcast_to(inputs.bits - cutoff_rate(H, P, classes, noise), n)

    power = inputs.variance * singular**2
    total = power.sum(axis=1)
    weak = total < _WEAK
    series = 0.5 * total - 0.25 * np.sum(power**2, axis=1)
    value[weak], error[weak] = series[weak] / _LN2, total[weak] ** 3 / _LN2
    saturated = ~weak & (gap <= 0.01 * tolerance)
    value[saturated], error[saturated] = inputs.bits, gap[saturated]
    remaining = ~weak & ~saturated

    part = inputs.part
    if part is not None:  # both dimensions are alike, and either carries a part of the symbol
        slots = np.flatnonzero(remaining)
        each, missed = by_quadrature(singular[slots, :1, None], part, tolerance / 2)
        value[slots], error[slots] = 2 * each, 2 * missed
        return Estimate(value, error, random)
    most = _POOLED_GRID_INPUTS if pooled else _GRID_INPUTS
    floor = _NEGLIGIBLE * np.minimum(1.0, singular[:, :1])
    dimensions = np.maximum(1, np.sum(singular > floor, axis=1))
    for d in np.unique(dimensions[remaining]):
        slots = np.flatnonzero(remaining & (dimensions == d))
        reduced = np.ascontiguousarray(maps[slots, :, :d])
        if d <= 2 and len(inputs.points) <= most:
            value[slots], error[slots] = by_quadrature(reduced, inputs, tolerance)
            continue
        random[slots] = True
        rare_errors = gap[slots] < _RARE
        for rare in (False, True):
            chosen = rare_errors == rare
            if chosen.any():
                value[slots[chosen]], error[slots[chosen]] = by_lattice(
                    reduced[chosen], inputs, random_tolerance, rng, rare=rare, pooled=pooled
                )
    return Estimate(value, error, random)


def mutual_information(
    H: RealOrComplex,
    P: RealOrComplex,
    modulation: str,
    noise: float,
    *,
    rng: np.random.Generator,
    tolerance: float = 1e-3,
) -> Estimate:
    """Return the mutual information of a link in every slot, (5) or (6), bit/s/Hz.

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
        Values, errors and whether the errors are random, (n,) each.

    Raises:
        InputError: unknown modulation, more than 65,536 input vectors, or a noise power or
            tolerance not above 0.

    >>> one = np.ones((1, 1, 1))
    >>> estimate = mutual_information(one, one, "bpsk", 1.0, rng=np.random.default_rng(1))
    >>> estimate.value.round(4), estimate.random
    (array([0.7215]), array([False]))
    """
    return _estimate(H, P, modulation, noise, rng, tolerance=tolerance, random_tolerance=tolerance)


def pooled_mutual_information(
    H: RealOrComplex,
    P: RealOrComplex,
    modulation: str,
    noise: float,
    *,
    rng: np.random.Generator,
    tolerance: float = 1e-3,
) -> Estimate:
    """Return (5) or (6) in every slot, bit/s/Hz, as accurately as their mean needs.

    Standard errors are independent from slot to slot, so each slot may err √n times as much as
    their mean; deterministic errors add up and get a quarter of the `tolerance`, the largest error
    wanted in the mean. The other arguments and the errors are those of ``mutual_information``.

    >>> one = np.ones((3, 1, 1))
    >>> slots = pooled_mutual_information(one, one, "qpsk", 1.0, rng=np.random.default_rng(1))
    >>> float(slots.value.mean().round(3)), slots.mean_error < 1e-3
    (0.972, True)
    """
    return _estimate(
        H,
        P,
        modulation,
        noise,
        rng,
        tolerance=0.25 * tolerance,
        random_tolerance=min(0.75 * tolerance * float(np.sqrt(len(H))), _ROUGH),
        pooled=True,
    )
