import numpy as np
import pytest

from faao_mav.errors import InputError
from faao_mav.radio.constellation import (
    MODULATIONS,
    constellation,
    difference_classes,
    difference_vector_count,
)


def test_number_of_classes() -> None:
    for modulation, antennas, count in (
        ("bpsk", 2, 4),
        ("qpsk", 2, 20),
        ("8psk", 2, 136),
        ("16qam", 2, 574),
        ("bpsk", 4, 40),
        ("qpsk", 3, 182),
    ):
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
    [*((m, n) for m in MODULATIONS for n in (1, 2)), ("8psk", 3), ("bpsk", 6)],
)
def test_every_pair_is_counted_once(modulation: str, antennas: int) -> None:
    classes = difference_classes(modulation, antennas)
    assert classes.symbols == len(constellation(modulation)) ** antennas
    assert classes.multiplicity.sum() + classes.symbols == classes.symbols**2
    assert classes.bits == pytest.approx(np.log2(classes.symbols))
    assert len(classes.vectors) < difference_vector_count(modulation, antennas)
    for shared in (classes.vectors, classes.multiplicity):
        assert not shared.flags.writeable


def test_what_is_refused() -> None:
    with pytest.raises(InputError, match=r"'psk8'.*8psk"):
        constellation("psk8")
