"""Precoders of highest mutual information."""

from typing import Any

import numpy as np
import pytest

from faao_mav.arrays import Complex
from faao_mav.radio.best_precoder import best_precoders
from faao_mav.radio.information_precoder import best_information_precoders
from faao_mav.radio.mutual_information import mutual_information

EXAMPLE = np.array([[2.0, 1.0], [1.0, 1.0]]) + 0j


def drawn(seed: int, *shape: int) -> Complex:
    parts = np.random.default_rng(seed).standard_normal((2, *shape))
    return np.asarray(parts[0] + 1j * parts[1])


@pytest.mark.parametrize("draws", [1, 8])
def test_polished_precoders_carry_more(draws: int) -> None:
    H = drawn(9, 6, draws, 2, 2) * np.linspace(0.3, 2, 6)[:, None, None, None]
    P = best_information_precoders(H, 1.5, "qpsk", 1.0)
    assert np.sum(np.abs(P) ** 2, axis=(1, 2)) == pytest.approx(np.full(6, 1.5))

    def carried(P: Complex) -> Any:
        return mutual_information(H, P[:, None], "qpsk", 1.0).mean(axis=1)

    before = best_information_precoders(H, 1.5, "qpsk", 1.0, start=np.tile(np.eye(2), (6, 1, 1)))
    identity = np.tile(np.sqrt(0.75) * np.eye(2), (6, 1, 1)) + 0j
    assert (carried(before) >= carried(identity) - 1e-12).all()
    assert carried(P).mean() > carried(before).mean() - 1e-3
    if draws == 1:
        cutoff = best_precoders(H[:, 0], 1.5, "qpsk", 1.0).P
        assert (carried(P) >= carried(cutoff) - 1e-12).all()
        assert (carried(P) - carried(cutoff)).max() > 0.02


def test_one_mode_carries_more_where_the_cutoff_rate_takes_two() -> None:
    """QPSK at -5 dB: 1.6376 bit on one mode, 1.4958 on those of the highest cutoff rate."""
    H = EXAMPLE[None] * np.sqrt(10**-0.5 / 2)
    P = best_information_precoders(H, 2.0, "qpsk", 1.0)
    assert mutual_information(H, P[None], "qpsk", 1.0)[0] > 1.63


def test_no_search_beats_the_closed_form_of_bpsk() -> None:
    H = np.exp(np.linspace(-2, 1.5, 8))[:, None, None, None] * np.diag([1.0, 0.6])
    closed = best_information_precoders(H, 1.0, "bpsk", 1.0)
    found = best_information_precoders(H, 1.0, "bpsk", 1.0, start=drawn(10, 8, 2, 2))
    carried = [mutual_information(H, P[:, None], "bpsk", 1.0)[:, 0] for P in (closed, found)]
    assert (carried[0] >= carried[1] - 2e-3).all()
