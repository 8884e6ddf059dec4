"""The log-likelihood in (5) and (6) of vectors received through a ``real_channel``."""

import math

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.radio.level_sum import level_sum

# Chosen; what a change costs is not measured.
CHUNK = 1 << 18  # likelihoods held at once: 2 MB, which stay in a processor's cache
_NOISES = 128  # noise samples handled together at least, which keeps the inner loops long
_ARRAYS = 4  # arrays that sums by parts hold at once


def log_ratio(
    points: Real, maps: Real, sent: Integers, z: Real, estimates: Real | None = None
) -> Real:
    """Compute ln Σ_k p(y|s_k) / p(y|s_m) at y = s_m + z, for every slot and noise.

    ``points`` (M, D) and ``maps`` (n, D, d) make s, ``sent`` (n, q) says m, ``z`` is (n, q, d);
    the result is (n, q). With ||y - s_k||² expanded, all exponents are one product of matrices.
    That of the vector sent is -||z||² / 2: the sum never underflows for noises that are drawn.
    ``estimates`` (n, q, D), where given, is filled with the means of the points given y.
    """
    result = np.empty(sent.shape)
    # Long rows of noises keep the inner loops long; the rest of the room goes to slots.
    group = max(1, CHUNK // (len(points) * min(sent.shape[1], _NOISES)))
    step = max(1, CHUNK // (len(points) * group))
    for first in range(0, len(maps), group):
        slots = slice(first, first + group)
        S = points @ maps[slots]
        ones = np.ones((*S.shape[:2], 1))
        left = np.concatenate([S, -0.5 * np.sum(S**2, axis=-1, keepdims=True), -ones], axis=-1)
        for start in range(0, sent.shape[1], step):
            part = slice(start, start + step)
            noise = z[slots, part]
            y = np.take_along_axis(S, sent[slots, part, None], axis=1) + noise
            half = 0.5 * np.sum(y**2, axis=-1, keepdims=True)
            right = np.concatenate([y, np.ones_like(half), half], axis=-1)
            logs = left @ np.swapaxes(right, 1, 2)
            np.exp(logs, out=logs)
            total = logs.sum(axis=1)
            result[slots, part] = np.log(total) + 0.5 * np.sum(noise**2, axis=-1)
            if estimates is not None:
                estimates[slots, part] = (logs.mT @ points) / total[..., None]
    return result


def log_ratio_by_parts(points: Real, levels: Real, maps: Real, sent: Integers, z: Real) -> Real:
    """Compute ``log_ratio`` for square alphabets, whose parts take the `levels` (L,) independently.

    With b and b' the rows of a slot's map for both parts of its strongest symbol, which are
    orthogonal and equally long, r = y - s of the other symbols and r_⊥ what b and b' leave of it,

        ||y - s_k||² = |r_⊥|² + |b|² (x - b r / |b|²)² + |b|² (x' - b' r / |b|²)²,

    so that the sum over that symbol is a product of two over L levels in place of one over L².
    """
    N = maps.shape[1] // 2
    result = np.empty(sent.shape)
    strongest = np.argmax(np.sum(maps[:, :N] ** 2, axis=-1), axis=1)
    for first in np.unique(strongest):
        others = _others(points, levels, first)
        step = max(1, CHUNK // (_ARRAYS * len(others)))
        group = max(1, step // sent.shape[1])
        slots = np.flatnonzero(strongest == first)
        for chosen in np.array_split(slots, math.ceil(len(slots) / group)):
            rows = maps[chosen][:, [first, N + first]]
            for start in range(0, sent.shape[1], step):
                part = np.s_[chosen, start : start + step]
                y = points[sent[part]] @ maps[chosen] + z[part]
                sums = _by_parts(y, levels, rows, others @ maps[chosen])
                result[part] = np.log(sums) + 0.5 * np.sum(z[part] ** 2, axis=-1)
    return result


def _others(points: Real, levels: Real, first: int) -> Real:
    """Return the vectors (R, D) of the other symbols, 0 where the symbol `first` is."""
    own = [first, points.shape[1] // 2 + first]
    others = points[np.all(points[:, own] == levels[0], axis=1)]
    others[:, own] = 0.0
    return others


def _by_parts(y: Real, levels: Real, rows: Real, others: Real) -> Real:
    """Return Σ_k exp(-||y - s_k||² / 2), (n, q), for received y (n, q, d).

    `rows` (n, 2, d) are b and b', `others` (n, R, d) what the other symbols send.
    """
    energy = np.sum(rows[:, :1] ** 2, axis=-1, keepdims=True)  # |b|², (n, 1, 1)
    along = rows.mT / np.where(energy > 0.0, energy, 1.0)
    received, sent = y @ along, others @ along
    sums = np.exp(-0.5 * _squares(others - sent @ rows, y - received @ rows))
    for part in range(2):
        apart = received[:, None, :, part] - sent[:, :, None, part]
        sums *= level_sum(apart, levels, np.ones(len(levels)), 0.5 * energy)
    return np.asarray(sums.sum(axis=1))


def _squares(a: Real, b: Real) -> Real:
    """Return ||a_i - b_j||², (n, i, j), of a (n, i, d) and b (n, j, d) as products of matrices."""

    def both(x: Real) -> tuple[Real, Real]:
        return np.sum(x**2, axis=-1, keepdims=True), np.ones((*x.shape[:-1], 1))

    (aa, one), (bb, other) = both(a), both(b)
    left = np.concatenate([a, aa, one], axis=-1)
    return np.asarray(left @ np.concatenate([-2.0 * b, other, bb], axis=-1).mT)
