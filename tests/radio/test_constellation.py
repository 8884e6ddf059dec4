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


def test_unit_energy_zero_mean_and_every_pair_once() -> None:
    for modulation in MODULATIONS:
        symbols = constellation(modulation)
        assert np.mean(np.abs(symbols) ** 2) == pytest.approx(1.0, abs=1e-14)
        assert abs(symbols.mean()) < 1e-14
        assert len(np.unique(np.round(symbols, 9))) == len(symbols)
        for antennas in (1, 2, *((3, 6) if modulation == "bpsk" else ())):
            classes = difference_classes(modulation, antennas)
            assert classes.symbols == len(symbols) ** antennas
            assert classes.multiplicity.sum() + classes.symbols == classes.symbols**2
            assert classes.bits == pytest.approx(np.log2(classes.symbols))
            assert len(classes.vectors) < difference_vector_count(modulation, antennas)
            for shared in (symbols, classes.vectors, classes.multiplicity):
                assert not shared.flags.writeable  # all are given the same array
    with pytest.raises(InputError, match=r"'psk8'.*8psk"):
        constellation("psk8")
