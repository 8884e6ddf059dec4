"""Signs of the curvature of a flight's Newton system, beside those of dense eigenvalues."""

import numpy as np
import pytest

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.banded import FlightMatrix

SLOTS, HALF_STEP = 9, 0.07


def dense(packed: Real, n: int) -> Real:
    xx, xy, yy = packed[:, 0, n]
    return np.array([[xx, xy], [xy, yy]])


def smallest_curvature(
    matrix: FlightMatrix, at_w: Real, at_v: Real, at_a: Real, fixed: tuple[bool, bool]
) -> float:
    """The least eigenvalue of M + Dᵀ C⁻¹ D on the null space of A, all of them dense."""
    n = SLOTS
    H, A = np.zeros((4 * n, 4 * n)), np.zeros((2 * (n - 1), 4 * n))
    eye = np.eye(2)
    for k in range(n):
        w, v = slice(2 * k, 2 * k + 2), slice(2 * (n + k), 2 * (n + k) + 2)
        H[w, w] += dense(at_w, k)
        H[v, v] += dense(at_v, k)
        if k < n - 1:
            S, w1, v1 = (
                dense(at_a, k),
                slice(w.start + 2, w.stop + 2),
                slice(v.start + 2, v.stop + 2),
            )
            H[v, v] += S
            H[v1, v1] += S
            H[v, v1] -= S
            H[v1, v] -= S
            row = slice(2 * k, 2 * k + 2)
            A[row, w1], A[row, w] = eye, -eye
            A[row, v], A[row, v1] = -HALF_STEP * eye, -HALF_STEP * eye
    held = [0, n - 1] + [n] * fixed[0] + [2 * n - 1] * fixed[1]
    free = [i for i in range(4 * n) if i // 2 not in held]
    H, A = H[np.ix_(free, free)], A[:, free]
    _, s, Vt = np.linalg.svd(A)
    null = Vt[(s > 1e-12).sum() :].T
    return float(np.linalg.eigvalsh(null.T @ H @ null).min())


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("fixed", [(False, False), (True, False), (True, True)])
def test_the_sign_of_the_curvature_is_that_of_dense_eigenvalues(
    seed: int, fixed: tuple[bool, bool]
) -> None:
    rng = np.random.default_rng(seed)
    matrix = FlightMatrix(SLOTS, HALF_STEP, fixed)
    at_w, at_v, at_a = (rng.normal(size=(3, 1, SLOTS)) for _ in range(3))
    at_a[::2] = np.abs(at_a[::2]) + 1.5
    base = smallest_curvature(matrix, at_w, at_v, at_a, fixed)
    for shift in (0.5, -0.5):  # just on either side of zero, as the speeds are stiffer or softer
        low, high = -1e3, 1e3
        for _ in range(60):
            middle = (low + high) / 2
            moved = at_v + middle * np.array([1.0, 0.0, 1.0])[:, None, None]
            curved = smallest_curvature(matrix, at_w, moved, at_a, fixed)
            low, high = (low, middle) if curved > 0 else (middle, high)
        moved = at_v + (high + shift) * np.array([1.0, 0.0, 1.0])[:, None, None]
        assert bool(matrix.positive(at_w, moved, at_a)[0, 0]) == (shift > 0)
    assert bool(matrix.positive(at_w, at_v, at_a)[0, 0]) == (base > 0)
