import numpy as np
import pytest

from faao_mav.errors import InputError
from faao_mav.radio.constellation import (
    MODULATIONS,
    constellation,
    difference_classes,
    difference_vector_count,
    symbol_vectors,
)

# Every case whose rho^{2N} pairs can be gone through one by one in about a second. Left out:
# 16-QAM and 64-QAM on 3 antennas (1.7e7 and 6.9e10 pairs) and 64-QAM on 2 (1.7e7); the count of
# pairs below covers 16-QAM on 3 and 64-QAM on 2.
ENUMERABLE = [
    (m, n) for m in MODULATIONS for n in (1, 2, 3) if len(constellation(m)) ** (2 * n) <= 300_000
]


@pytest.mark.parametrize(
    ("modulation", "antennas", "count"),
    [
        ("bpsk", 2, 4),
        ("qpsk", 2, 20),
        ("8psk", 2, 136),
        ("16qam", 2, 574),
        ("bpsk", 4, 40),
        ("qpsk", 3, 182),
    ],
)
def test_number_of_classes(modulation: str, antennas: int, count: int) -> None:
    assert len(difference_classes(modulation, antennas).vectors) == count


@pytest.mark.parametrize("modulation", MODULATIONS)
def test_unit_energy_and_zero_mean(modulation: str) -> None:
    symbols = constellation(modulation)
    assert np.mean(np.abs(symbols) ** 2) == pytest.approx(1.0, abs=1e-14)
    assert abs(symbols.mean()) < 1e-14
    assert len(np.unique(np.round(symbols, 9))) == len(symbols)
    assert not symbols.flags.writeable  # all are given the same array


@pytest.mark.parametrize(
    ("modulation", "antennas"),
    [*((m, n) for m in MODULATIONS for n in (1, 2)), ("8psk", 3), ("16qam", 3), ("bpsk", 6)],
)
def test_every_pair_is_counted_once(modulation: str, antennas: int) -> None:
    classes = difference_classes(modulation, antennas)
    assert classes.symbols == len(constellation(modulation)) ** antennas
    assert classes.multiplicity.sum() + classes.symbols == classes.symbols**2
    assert classes.weight.sum() == pytest.approx(1.0 - 1.0 / classes.symbols)
    assert classes.bits == pytest.approx(np.log2(classes.symbols))
    assert len(classes.vectors) < difference_vector_count(modulation, antennas)
    for shared in (classes.vectors, classes.multiplicity):
        assert not shared.flags.writeable


@pytest.mark.parametrize(("modulation", "antennas"), ENUMERABLE)
@pytest.mark.parametrize("scale", [0.1, 1.0, 5.0])
def test_merged_sum_equals_the_sum_over_pairs(modulation: str, antennas: int, scale: float) -> None:
    rng = np.random.default_rng(antennas)
    A = scale * (rng.standard_normal((2, antennas)) + 1j * rng.standard_normal((2, antennas)))
    received = symbol_vectors(modulation, antennas) @ A.T
    total = sum(np.exp(-np.sum(np.abs(r - received) ** 2, axis=1) / 4).sum() for r in received)
    classes = difference_classes(modulation, antennas)
    D = np.sum(np.abs(classes.vectors @ A.T) ** 2, axis=1) / 4
    assert classes.symbols + classes.multiplicity @ np.exp(-D) == pytest.approx(total, rel=1e-12)


def test_what_is_refused() -> None:
    with pytest.raises(InputError, match=r"'psk8'.*8psk"):
        constellation("psk8")
