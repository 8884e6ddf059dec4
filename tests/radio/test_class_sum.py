from itertools import product

import numpy as np
import pytest

from faao_mav.arrays import Complex, Real
from faao_mav.radio import rate
from faao_mav.radio.constellation import constellation, coordinates, difference_classes, features
from faao_mav.radio.rate import SquareSum


def pair_sums(modulation: str, antennas: int, Z: Complex) -> Real:
    """The sums over all differences of two vectors but 0, one after another, with u^H Z u."""
    symbols = constellation(modulation)
    values, counts = np.unique(np.round(symbols[:, None] - symbols, 13).ravel(), return_counts=True)
    index = np.array(list(product(range(len(values)), repeat=antennas)))
    u, pairs = values[index], counts[index].prod(axis=1)
    pairs = np.where(np.any(u != 0.0, axis=1), pairs, 0) / float(len(symbols)) ** antennas
    phi = features(u)
    terms = np.column_stack([np.ones(len(u)), phi])
    D = [np.sum(np.conj(u) * (u @ z.T), axis=1).real for z in Z]
    return np.array([(pairs * np.exp(-d)) @ terms for d in D])


@pytest.mark.parametrize(("modulation", "antennas"), [("16qam", 2), ("16qam", 3)])
def test_sums_over_all_differences(
    modulation: str, antennas: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = np.random.default_rng(5).standard_normal((2, 9, 3, antennas))
    A = (parts[0] + 1j * parts[1]) * np.array([0.05, 0.3, 1.0] * 3)[:, None, None]
    A[1, :, 0] = 0.0  # a stream without power
    A[2, :, 0] *= 1e-9
    A[3] = A[3, :, :1] * (1.0 + np.arange(antennas))  # all streams on one mode
    A[4] = 0.0
    A[5] *= 1e-160
    A[6, :, -1] *= 30.0
    Z = A.conj().mT @ A
    classes = difference_classes(modulation, antennas)
    sums = SquareSum(classes)
    expected = pair_sums(modulation, antennas, Z)
    scale = np.abs(expected).max(axis=1, keepdims=True)
    for block in (1, 1 << 18):
        monkeypatch.setattr(rate, "_BLOCK", block)
        found = sums.sums(coordinates(Z), 1 + antennas**2)
        np.testing.assert_allclose(found / scale, expected / scale, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(sums.sums(coordinates(Z), 1), found[:, :1], rtol=1e-12)
