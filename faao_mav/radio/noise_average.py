"""Averages of the log-likelihood in (5) and (6) over the inputs and the noise.

Only the noise within the span of H P u matters; the rest cancels in (5). A link is therefore turned
into a real channel y = s + z: received points s in as few dimensions as H P leaves them, and
z ~ N(0, I) there.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Complex, Real
from faao_mav.errors import InputError
from faao_mav.radio.constellation import constellation, symbol_vectors
from faao_mav.radio.gaussian_average import lattice, normal_from_uniform, normal_grid

_LN2 = float(np.log(2.0))
_CHUNK = 1 << 18  # likelihoods held at once, 2 MB: what stays in a processor's cache is fast
_ROW = 128  # noises handled together at least
_LARGEST = 1 << 16  # input vectors
_GRID_SPACING = (0.8, 0.03)  # the first and the last tried, standard deviations
_SHIFTS = 16
_WIDE = 2.0  # standard deviation of the noises that look for rare errors
_LATTICE = (16, 1 << 15)  # points per shift, the first and the last number tried
_POOLED = 4  # the first where it is all slots together that have to meet the tolerance


@dataclass(frozen=True, eq=False)
class RealInputs:
    """The input vectors as real vectors, and those over which it is enough to average."""

    points: Real  # (M, D)
    sent: NDArray[np.intp]  # (r,), r the product of choices
    choices: tuple[int, ...]  # how many symbols on each antenna, the last running fastest
    variance: float  # of each real coordinate
    bits: float


def real_inputs(modulation: str, antennas: int) -> RealInputs:
    """Return the input vectors in real coordinates.

    Raises:
        InputError: unknown modulation, or more than 65,536 input vectors.
    """
    symbols = constellation(modulation)
    size = len(symbols) ** antennas
    if size > _LARGEST:
        raise InputError(
            f"{modulation} on {antennas} antennas has {size} input vectors; "
            f"the mutual information is computed for up to {_LARGEST}"
        )
    x = symbol_vectors(modulation, antennas)
    # A rotation that maps the alphabet onto itself maps the noise onto equally likely noise:
    # vectors that differ by one contribute the same, and no vector is left fixed.
    if modulation == "bpsk":
        points, variance, keep = x.real, 1.0, symbols.real > 0.0
    else:
        points, variance = np.hstack([x.real, x.imag]), 0.5
        sector = 2.0 * np.pi / (8 if modulation == "8psk" else 4)
        angle = np.angle(symbols) % (2.0 * np.pi)
        keep = (angle + 1e-9) % (2.0 * np.pi) < sector
    # The first entry runs slowest in symbol_vectors.
    sent = np.flatnonzero(np.repeat(keep, size // len(symbols)))
    choices = (int(np.count_nonzero(keep)), *[len(symbols)] * (antennas - 1))
    return RealInputs(np.ascontiguousarray(points), sent, choices, variance, float(np.log2(size)))


def real_channel(H: Complex, P: Complex, noise: float, real: bool) -> tuple[Real, Real]:
    """Return what a link does to real inputs, in units of the noise.

    Args:
        H: (n, N_r, N_t) channels.
        P: (n, N_t, N_t) precoders.
        noise: σ², W.
        real: whether the alphabet is real, which leaves D = N_t coordinates instead of 2 N_t.

    Returns:
        Singular values (n, d), largest first, and the maps (n, D, d): s = points @ map.
    """
    A = np.asarray(H) @ np.asarray(P) * np.sqrt(2.0 / noise)
    left = np.concatenate([A.real, A.imag], axis=-2)
    B = left if real else np.concatenate([left, np.concatenate([-A.imag, A.real], -2)], axis=-1)
    _, singular, right = np.linalg.svd(B, full_matrices=False)
    return singular, np.swapaxes(right, -1, -2) * singular[..., None, :]


def _log_ratio(points: Real, maps: Real, sent: NDArray[np.intp], z: Real) -> Real:
    """Compute ln Σ_k p(y|s_k) / p(y|s_m) at y = s_m + z, for every slot and noise.

    ``points`` (M, D) and ``maps`` (n, D, d) make s, ``sent`` (n, q) says m, ``z`` is (n, q, d);
    the result is (n, q). With ||y - s_k||² expanded, all sums over k are one product of matrices.
    """
    result = np.empty(sent.shape)
    # Long rows of noises keep the inner loops long; the rest of the room goes to slots.
    group = max(1, _CHUNK // (len(points) * min(sent.shape[1], _ROW)))
    step = max(1, _CHUNK // (len(points) * group))
    for first in range(0, len(maps), group):
        slots = slice(first, first + group)
        S = points @ maps[slots]
        half = 0.5 * np.sum(S**2, axis=-1)[..., None]
        for start in range(0, sent.shape[1], step):
            part = slice(start, start + step)
            s = np.take_along_axis(S, sent[slots, part, None], axis=1)
            y = s + z[slots, part]
            logs = S @ np.swapaxes(y, 1, 2)
            logs -= half
            largest = logs.max(axis=1)
            logs -= largest[:, None]
            np.exp(logs, out=logs)
            own = np.sum((y - 0.5 * s) * s, axis=-1)
            result[slots, part] = np.log(logs.sum(axis=1)) + largest - own
    return result


def by_quadrature(maps: Real, inputs: RealInputs, tolerance: float) -> tuple[Real, Real]:
    """Return the mean over inputs and noise by ever finer grids.

    Args:
        maps: (n, D, d) from ``real_channel``, columns that matter only.
        inputs: from ``real_inputs``.
        tolerance: change at which a slot is settled, bits.

    Returns:
        Values and errors (n,), bits: the last change, or a quarter of the one before if that is
        more, since one small change may be chance.
    """
    n, _, d = maps.shape
    value, change, error = np.full(n, np.inf), np.full(n, np.inf), np.full(n, np.inf)
    active = np.arange(n)
    spacing, finest = _GRID_SPACING
    while len(active) and spacing > finest:
        z, weight = normal_grid(d, spacing)
        sent = np.repeat(inputs.sent, len(z))[None]
        z = np.tile(z, (len(inputs.sent), 1))[None]
        step = max(1, _CHUNK // (z.shape[1] * d))
        for start in range(0, len(active), step):
            slots = active[start : start + step]
            size = (len(slots), *z.shape[1:])
            logs = _log_ratio(
                inputs.points,
                maps[slots],
                np.broadcast_to(sent, size[:2]),
                np.broadcast_to(z, size),
            )
            mean = np.mean(logs.reshape(len(slots), len(inputs.sent), -1) @ weight, axis=1) / _LN2
            latest = np.abs(inputs.bits - mean - value[slots])
            error[slots] = np.maximum(latest, 0.25 * change[slots])
            value[slots], change[slots] = inputs.bits - mean, latest
        active = active[error[active] > tolerance]
        spacing /= np.sqrt(2.0)
    return value, error


def by_lattice(
    maps: Real,
    inputs: RealInputs,
    tolerance: float,
    rng: np.random.Generator,
    *,
    rare: bool = False,
    pooled: bool = False,
) -> tuple[Real, Real]:
    """Return the mean over inputs and noise by randomly shifted lattices.

    One coordinate per antenna chooses the vector sent, the others the noise; every noise is used
    with both signs, which removes all that is odd in it.

    Args:
        maps: (n, D, d) from ``real_channel``, columns that matter only.
        inputs: from ``real_inputs``.
        tolerance: standard error wanted, bits.
        rng: source of the shifts.
        rare: sample large noises more often, and weigh them accordingly. Where errors are rare,
            plain samples may meet none and claim a certainty that they do not have.
        pooled: refine all slots until their root mean square error meets the tolerance. A slot
            that stops by itself stops a little too happily where it met few errors: unnoticed in
            one slot, but a bias that a mean over many does not take away.

    Returns:
        Values and standard errors (n,), bits.
    """
    n, _, d = maps.shape
    antennas = len(inputs.choices)
    coordinates = antennas + d + d % 2
    shift = rng.random((n, _SHIFTS, 1, coordinates))

    def means(slots: NDArray[np.intp], grid: Real) -> Real:
        """One mean per shift, (len(slots), shifts), in nats."""
        u = (grid + shift[slots]) % 1.0
        chosen = (u[..., :antennas] * inputs.choices).astype(np.intp)
        sent = inputs.sent[np.ravel_multi_index(tuple(np.moveaxis(chosen, -1, 0)), inputs.choices)]
        z = normal_from_uniform(u[..., antennas:])[..., :d]
        sent = np.concatenate([sent, sent], axis=-1).reshape(len(slots), -1)
        z = np.concatenate([z, -z], axis=-2).reshape(len(slots), -1, d)
        logs = _log_ratio(inputs.points, maps[slots], sent, z)
        if rare:
            logs *= _mixture_weight(z)
            wide = _log_ratio(inputs.points, maps[slots], sent, _WIDE * z)
            logs = 0.5 * (logs + wide * _mixture_weight(_WIDE * z))
        mean: Real = logs.reshape(len(slots), _SHIFTS, -1).mean(axis=-1)
        return mean

    def all_means(slots: NDArray[np.intp], grid: Real) -> Real:
        step = max(1, _CHUNK // (2 * _SHIFTS * len(grid)))
        parts = [means(slots[i : i + step], grid) for i in range(0, len(slots), step)]
        return np.concatenate(parts)

    active = np.arange(n)
    count, most = _LATTICE
    if pooled:
        count = _POOLED
    mean = all_means(active, lattice(count, coordinates))
    error = _spread(mean)
    while count < most:
        if not pooled:
            active = active[error[active] > tolerance]
        elif np.sqrt(np.mean(error**2)) <= tolerance:
            break
        if not len(active):
            break
        finer = all_means(active, lattice(count, coordinates, refine=True))
        mean[active] = 0.5 * (mean[active] + finer)
        error[active] = _spread(mean[active])
        count *= 2
    return inputs.bits - mean.mean(axis=1) / _LN2, error


def _mixture_weight(z: Real) -> Real:
    """Return the density of N(0, I) over that of its equal mixture with N(0, _WIDE² I)."""
    squared = np.sum(z**2, axis=-1)
    ratio = _WIDE ** -z.shape[-1] * np.exp(np.minimum(0.5 * squared * (1 - _WIDE**-2), 700.0))
    weight: Real = 2.0 / (1.0 + ratio)
    return weight


def _spread(mean: Real) -> Real:
    deviation: Real = np.std(mean, axis=1, ddof=1) / np.sqrt(mean.shape[1]) / _LN2
    return deviation
