"""Averages of the log-likelihood in (5) and (6) over the inputs and the noise.

Two rules average over the noise of a ``real_channel``: a grid in one or two dimensions
(``by_quadrature``) and randomly shifted lattices in any number (``by_lattice``). The lattice is ten
lines of the project's own: importing scipy.stats.qmc takes 1.4 s, this module 0.03 s.
"""

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.radio.likelihood import CHUNK, log_ratio, log_ratio_by_parts
from faao_mav.radio.real_channel import RealInputs

_LN2 = float(np.log(2.0))

# Chosen, unless another reason is given; what a change costs is not measured.
_REACH = 6.5  # radius of the grid, standard deviations: less than 1e-9 of the mass lies beyond
_FIRST_SPACING, _LAST_SPACING = 0.8, 0.03  # of the grids, standard deviations; √2 finer each time
_SHIFTS = 16  # random shifts per lattice; their spread is the standard error
_FIRST_POINTS, _MOST_POINTS = 16, 1 << 15  # lattice points per shift: a million samples at most
_FIRST_POINTS_POOLED = 4  # the first number where all slots meet the tolerance together
_WIDE = 2.0  # standard deviation of the noises that are sampled where errors are rare

_KOROBOV = 826727
"""Generator of the lattice: its powers are the rule. Of 300 numbers drawn at random it has the
smallest P_2 figures over 2^5 to 2^10 points in 3 to 9 dimensions."""


def normal_grid(dimensions: int, spacing: float) -> tuple[Real, Real]:
    """Return nodes (g, dimensions) and weights (g,) of the trapezoidal rule for N(0, I) means.

    On the whole line the trapezoidal rule converges exponentially for functions analytic in a
    strip, as the logarithm of a sum of exponentials is, and needs no more nodes than Gauss-Hermite:
    Trefethen and Weideman, "The exponentially convergent trapezoidal rule", SIAM Review 56 (2014).
    Neighbouring nodes are `spacing` standard deviations apart, all lie in a ball of 6.5; the
    weights sum to 1.

    >>> z, weight = normal_grid(1, 0.5)
    >>> abs(float(weight @ z[:, 0] ** 2) - 1.0) < 1e-8
    True
    """
    steps = int(_REACH / spacing)
    line = spacing * np.arange(-steps, steps + 1)
    index = np.indices((len(line),) * dimensions).reshape(dimensions, -1)
    nodes = line[index].T
    squared = np.sum(nodes**2, axis=1)
    inside = squared <= _REACH**2
    weights = np.exp(-0.5 * squared[inside])
    return np.ascontiguousarray(nodes[inside]), weights / np.sum(weights)


def lattice(points: int, dimensions: int, *, refine: bool = False) -> Real:
    """Return a rank-1 lattice in the unit cube, (points, dimensions).

    `points` is a power of two up to 2^19. The first coordinate alone is evenly spaced in order.
    With `refine` it is the points that, together with ``lattice(points, dimensions)``, make up
    ``lattice(2 * points, dimensions)``.

    >>> lattice(4, 1).ravel().tolist(), lattice(2, 1, refine=True).ravel().tolist()
    ([0.0, 0.25, 0.5, 0.75], [0.25, 0.75])
    """
    total = 2 * points if refine else points
    steps = np.arange(1, total, 2) if refine else np.arange(total)
    generator = np.array([pow(_KOROBOV, j, total) for j in range(dimensions)], dtype=np.int64)
    return (steps[:, None] * generator % total) / total


def normal_from_uniform(uniform: Real) -> Real:
    """Return normal coordinates of uniform ones in [0, 1), (..., 2 k) each (Box and Muller).

    The first k are from cosines, the others from sines.

    >>> normal_from_uniform(np.array([0.5, 0.25])).round(6)
    array([0.     , 1.17741])
    """
    half = uniform.shape[-1] // 2
    radius = np.sqrt(-2.0 * np.log1p(-uniform[..., :half]))
    angle = 2.0 * np.pi * uniform[..., half:]
    return np.concatenate([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def by_quadrature(maps: Real, inputs: RealInputs, tolerance: float) -> tuple[Real, Real]:
    """Return (5) or (6) by the trapezoidal rule over the noise, on ever finer grids.

    `maps` (n, D, d) are those of ``real_channel``, columns that matter only, `inputs` those of
    ``real_inputs``; a slot is settled where it changes by no more than `tolerance`, bits. The
    values and errors (n,) are bits. The error is the last change, or a quarter of the one before if
    that is more, since one small change may be chance.

    >>> from faao_mav.radio.real_channel import real_inputs
    >>> inputs = real_inputs("bpsk", 1)
    >>> value, error = by_quadrature(np.array([[[np.sqrt(2.0)]]]), inputs, 1e-6)
    >>> value.round(4)
    array([0.7215])
    """
    n, _, d = maps.shape
    value, change, error = np.full(n, np.inf), np.full(n, np.inf), np.full(n, np.inf)
    active = np.arange(n)
    spacing = _FIRST_SPACING
    while len(active) and spacing > _LAST_SPACING:
        z, weight = normal_grid(d, spacing)
        sent = np.repeat(inputs.sent, len(z))[None]
        z = np.tile(z, (len(inputs.sent), 1))[None]
        step = max(1, CHUNK // (z.shape[1] * d))
        for start in range(0, len(active), step):
            slots = active[start : start + step]
            size = (len(slots), *z.shape[1:])
            logs = log_ratio(
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


def gaussian_controls(
    inputs: RealInputs, maps: Real, moment: Real, sent: Integers, z: Real
) -> Real:
    """Return terms of mean 0 that vary like ``log_ratio`` at the same arguments, (n, q, 2).

    Were the inputs Gaussian, ln p(y) / p(y|s_m) would be a constant and Σ_d (z_d² - y_d² / E y_d²)
    / 2. Its means are exact for any alphabet, as they take second moments only: `moment` (D, D) is
    the mean of x x^T over the vectors ``inputs.sent``. The columns of `maps` are orthogonal; the
    sum over the stronger half of them and that over the weaker half are a term each.

    >>> from faao_mav.radio.real_channel import real_inputs
    >>> inputs, z = real_inputs("bpsk", 1), np.array([[[1.0], [-1.0]]])
    >>> maps, sent = np.array([[[1.0]]]), np.array([[1, 1]])
    >>> gaussian_controls(inputs, maps, np.eye(1), sent, z)[0, :, 0].tolist()
    [-0.5, 0.5]
    """
    variance = 1.0 + inputs.variance * np.sum(maps**2, axis=1)[:, None]
    y = (inputs.points @ maps)[np.arange(len(maps))[:, None], sent] + z
    received = 1.0 + np.sum(maps * (moment @ maps), axis=1)[:, None]
    terms = 0.5 * (y**2 / variance - z**2 + 1.0 - received / variance)
    half = (maps.shape[-1] + 1) // 2
    halves = [part.sum(axis=-1) for part in (terms[..., :half], terms[..., half:])]
    return np.asarray(np.stack(halves, axis=-1))


def _both_signs(x: Real, points: int) -> Real:
    """Return the means over the signs of the noises, (n, shifts, points, ...)."""
    return np.asarray(x.reshape(len(x), _SHIFTS, 2, points, *x.shape[2:]).mean(axis=2))


def _controlled(logs: Real, controls: Real) -> Real:
    """Return the means over the points, (n, shifts), less what the `controls` of mean 0 explain.

    `logs` are (n, shifts, points), `controls` (n, shifts, points, 2). Each half of the shifts takes
    its coefficients from the regression of the other half, so that the means stay unbiased.
    """
    means: Real = logs.mean(axis=2)
    half = _SHIFTS // 2
    for here, other in ((slice(half), slice(half, None)), (slice(half, None), slice(half))):
        x = controls[:, other].reshape(len(logs), -1, controls.shape[-1])
        x = x - x.mean(axis=1, keepdims=True)
        gram = x.mT @ x
        scale = np.trace(gram, axis1=1, axis2=2)[:, None, None] + 1e-300
        along = x.mT @ logs[:, other].reshape(len(logs), -1, 1)
        ridge = 1e-9 * np.eye(gram.shape[-1])
        slope = np.linalg.solve(gram / scale + ridge, along / scale)[:, None]
        means[:, here] -= (controls[:, here].mean(axis=2)[:, :, None] @ slope)[..., 0, 0]
    return means


def by_lattice(
    maps: Real,
    inputs: RealInputs,
    tolerance: float,
    rng: np.random.Generator,
    *,
    rare: bool = False,
    pooled: bool = False,
) -> tuple[Real, Real]:
    """Return (5) or (6) as a mean over randomly shifted lattices.

    One coordinate per antenna chooses the vector sent, the others the noise; every noise is used
    with both signs, which removes all that is odd in it.

    Args:
        maps: (n, D, d) from ``real_channel``, columns that matter only.
        inputs: from ``real_inputs``.
        tolerance: standard error wanted, bits.
        rng: source of the shifts.
        rare: sample large noises more often, and weigh them accordingly. Where errors are rare,
            plain samples may contain none, and their spread would then be zero.
        pooled: refine all slots until their root mean square error meets the tolerance. Slots that
            stop one by one stop too early where their samples met few errors: a bias that the mean
            over many slots does not take away. `gaussian_controls` then take away what Gaussian
            inputs share with the alphabet: errors are 1.5 to 3.4 times smaller with QPSK to 64-QAM
            at half the rate that they allow, and more below. Where single slots stop, it is left
            in: the regression's own error is not in their spread.

    Returns:
        Values and standard errors (n,), bits.

    >>> from faao_mav.radio.real_channel import real_inputs
    >>> inputs, rng = real_inputs("bpsk", 1), np.random.default_rng(1)
    >>> value, error = by_lattice(np.array([[[np.sqrt(2.0)]]]), inputs, 1e-3, rng)
    >>> bool(abs(value[0] - 0.7215) < 5 * error[0] < 5e-3)
    True
    """
    n, _, d = maps.shape
    antennas = len(inputs.choices)
    coordinates = antennas + d + d % 2
    moment = inputs.points[inputs.sent].T @ inputs.points[inputs.sent] / len(inputs.sent)
    shift = rng.random((n, _SHIFTS, 1, coordinates))

    def means(slots: Integers, grid: Real) -> Real:
        """One mean per shift, (len(slots), shifts), in nats."""
        u = (grid + shift[slots]) % 1.0
        chosen = (u[..., :antennas] * inputs.choices).astype(np.intp)
        sent = inputs.sent[np.ravel_multi_index(tuple(np.moveaxis(chosen, -1, 0)), inputs.choices)]
        z = normal_from_uniform(u[..., antennas:])[..., :d]
        sent = np.concatenate([sent, sent], axis=-1).reshape(len(slots), -1)
        z = np.concatenate([z, -z], axis=-2).reshape(len(slots), -1, d)
        logs = likelihood(maps[slots], sent, z)
        if pooled and not rare:
            controls = gaussian_controls(inputs, maps[slots], moment, sent, z)
            return _controlled(*(_both_signs(x, len(grid)) for x in (logs, controls)))
        if rare:
            logs *= _mixture_weight(z)
            wide = likelihood(maps[slots], sent, _WIDE * z)
            logs = 0.5 * (logs + wide * _mixture_weight(_WIDE * z))
        return np.asarray(logs.reshape(len(slots), _SHIFTS, -1).mean(axis=-1))

    def likelihood(maps: Real, sent: Integers, z: Real) -> Real:
        if inputs.levels is None:
            return log_ratio(inputs.points, maps, sent, z)
        return log_ratio_by_parts(inputs.points, inputs.levels, maps, sent, z)

    def all_means(slots: Integers, grid: Real) -> Real:
        step = max(1, CHUNK // (2 * _SHIFTS * len(grid)))
        parts = [means(slots[i : i + step], grid) for i in range(0, len(slots), step)]
        return np.concatenate(parts)

    active = np.arange(n)
    count = _FIRST_POINTS_POOLED if pooled else _FIRST_POINTS
    mean = all_means(active, lattice(count, coordinates))
    error = _spread(mean)
    while count < _MOST_POINTS:
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
    """Return the standard error (n,), bits, of the mean over the shifts (n, shifts), nats."""
    deviation: Real = np.std(mean, axis=1, ddof=1) / np.sqrt(mean.shape[1]) / _LN2
    return deviation
