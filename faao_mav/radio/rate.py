"""The cutoff rate, (7) and (8): a lower bound on the mutual information, in closed form."""

import math
from collections.abc import Sequence

import numpy as np

from faao_mav.arrays import Complex, Real, RealOrComplex
from faao_mav.errors import InputError
from faao_mav.radio.class_sum import class_sum
from faao_mav.radio.constellation import DifferenceClasses
from faao_mav.radio.quadratic_form import coordinates, features

_CHUNK = 1 << 16  # exponents held at once: 512 kB stay in the cache, 15 % quicker than 16 MB
_PAIRS = 1 << 17  # channels with their precoders taken together: bounds the memory; chosen
_CLASSES = 2048  # classes taken together: those of the largest alphabets would not stay there


def _received(H: RealOrComplex, P: RealOrComplex, noise: float) -> Complex:
    """Return H P / (2 σ), (..., N_r, N_t): the exponents are squared norms of it times u."""
    if not noise > 0.0:
        raise InputError(f"the noise power must be above 0, got {noise}")
    return np.asarray(np.asarray(H) @ np.asarray(P) / (2.0 * np.sqrt(noise)), dtype=np.complex128)


def exponents(H: RealOrComplex, P: RealOrComplex, u: RealOrComplex, noise: float) -> Real:
    """Return the exponents D = ||H P u||² / (4 σ²) of (7) and (8), (..., k), never negative.

    `H` (..., N_r, N_t) are channels and `P` (..., N_t, N_t) precoders, whose leading axes
    broadcast; `u` (k, N_t) are differences of input vectors, ``DifferenceClasses.vectors``; `noise`
    is σ², W. Raises `InputError` for a noise not above 0.

    >>> exponents(np.eye(1), np.eye(1), np.array([[2.0 + 0j]]), 0.5)
    array([2.])
    """
    A = _received(H, P, noise)
    D: Real = coordinates(A.conj().mT @ A) @ features(np.asarray(u, dtype=np.complex128)).T
    return np.maximum(D, 0.0, out=D)


def cutoff_rate(
    H: RealOrComplex, P: RealOrComplex, classes: DifferenceClasses, noise: float
) -> Real:
    """Return the cutoff rate of a link, (7) or (8), in bit/s/Hz, (...) from 0 to ``classes.bits``.

    R_0 = 2 N log2(rho) - log2 Σ_m Σ_k exp(-||H P u_mk||² / (4 σ²)), the double sum taken over the
    classes. In terms of the class probabilities it is -log2(1 + Σ weight (e^-D - 1)), exact where
    the rate is small, and N log2(rho) - log2(1 + Σ multiplicity e^-D / rho^N), exact where it is
    nearly N log2(rho); each is used on its side.

    `H` (..., N_r, N_t) are channels and `P` (..., N_t, N_t) precoders, whose leading axes
    broadcast; `classes` are the differences of the alphabet on N_t antennas; `noise` is σ², W.
    Raises `InputError` for a noise not above 0.

    >>> from faao_mav.radio.constellation import difference_classes
    >>> float(cutoff_rate(np.eye(1), np.eye(1), difference_classes("bpsk", 1), 1.0).round(6))
    0.548059
    """
    H, P = np.asarray(H, dtype=np.complex128), np.asarray(P, dtype=np.complex128)
    shape = np.broadcast_shapes(H.shape[:-2], P.shape[:-2])
    if math.prod(shape) > _PAIRS:
        axis = int(np.argmax(shape)) - len(shape) - 2
        parts = -(-math.prod(shape) // _PAIRS)
        return np.concatenate(
            [
                cutoff_rate(*part, classes, noise)
                for part in zip(_split(H, axis, parts), _split(P, axis, parts), strict=True)
            ],
            axis=axis + 2,
        )
    A = _received(H, P, noise)
    z = coordinates(A.conj().mT @ A)
    flat = z.reshape(-1, z.shape[-1])
    rate = classes.bits - np.logaddexp(0.0, class_sum(classes).value(flat)) / np.log(2.0)
    low = rate < 1.0
    rate[low] = -np.log1p(_mean_fall(flat[low], classes)) / np.log(2.0)
    bounded: Real = np.clip(rate, 0.0, classes.bits).reshape(z.shape[:-1])[()]
    return bounded


def _split(M: Complex, axis: int, parts: int) -> Sequence[Complex]:
    """Return M (..., N, N) in parts along an axis, or M itself for each if it has none there."""
    if M.ndim < -axis or M.shape[axis] == 1:
        return [M] * parts
    return [*np.array_split(M, parts, axis)]


def _mean_fall(z: Real, classes: DifferenceClasses) -> Real:
    """Return Σ weight (e^-D - 1) over the classes, (n,), at the coordinates z (n, N²)."""
    total = np.zeros(len(z))
    step = max(1, _CHUNK // min(_CLASSES, len(classes.vectors)))
    for first in range(0, len(classes.vectors), _CLASSES):
        phi = -features(classes.vectors[first : first + _CLASSES]).T
        weight = classes.weight[first : first + _CLASSES]
        for start in range(0, len(z), step):
            part = slice(start, start + step)
            D = z[part] @ phi
            np.minimum(D, 0.0, out=D)
            total[part] += np.expm1(D, out=D) @ weight
    return total
