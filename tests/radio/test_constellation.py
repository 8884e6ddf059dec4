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


@pytest.mark.parametrize("modulation", MODULATIONS)
@pytest.mark.parametrize("antennas", [1, 2])
def test_symbol_vectors_have_unit_covariance(modulation: str, antennas: int) -> None:
    x = symbol_vectors(modulation, antennas)
    np.testing.assert_allclose(x.T @ x.conj() / len(x), np.eye(antennas), atol=1e-13)


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


@pytest.mark.parametrize("modulation", MODULATIONS)
def test_no_two_classes_differ_by_a_phase_only(modulation: str) -> None:
    u = difference_classes(modulation, 2).vectors
    # Turn each so that its first entry that is not zero is real and positive.
    lead = np.where(np.abs(u[:, 0]) > 1e-9, u[:, 0], u[:, 1])
    turned = np.round(u * (np.abs(lead) / lead)[:, None], 8) + 0.0
    assert len(np.unique(turned, axis=0)) == len(u)


def test_arrays_are_read_only_and_cached() -> None:
    classes = difference_classes("qpsk", 2)
    assert classes is difference_classes("qpsk", 2)
    for array in (classes.vectors, classes.multiplicity, constellation("qpsk")):
        assert not array.flags.writeable


def test_what_is_refused() -> None:
    with pytest.raises(InputError, match=r"'psk8'.*8psk"):
        constellation("psk8")
