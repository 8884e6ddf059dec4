"""The mutual information at fixed noises, and the precoders that maximise it."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.arrays import Complex
from faao_mav.errors import InputError
from faao_mav.radio.best_precoder import best_precoders
from faao_mav.radio.constellation import difference_classes
from faao_mav.radio.fixed_noise import fixed_noise_information, information_and_errors
from faao_mav.radio.information_precoder import best_information_precoders
from faao_mav.radio.rate import cutoff_rate

EXAMPLE = np.array([[2.0, 1.0], [1.0, 1.0]]) + 0j


def drawn(seed: int, *shape: int) -> Complex:
    parts = np.random.default_rng(seed).standard_normal((2, *shape))
    return np.asarray(parts[0] + 1j * parts[1])


@pytest.mark.figures
@pytest.mark.parametrize(
    ("modulation", "decibels", "exact"),
    [
        ("bpsk", -5, 0.8457),
        ("bpsk", 0, 1.4578),
        ("bpsk", 5, 1.9057),
        ("qpsk", 0, 2.1662),
        ("qpsk", 5, 3.3584),
        ("qpsk", 10, 3.9444),
    ],
)
def test_values_known_from_quadrature(modulation: str, decibels: float, exact: float) -> None:
    H = EXAMPLE[None] * np.sqrt(10 ** (decibels / 10) / 2)
    value = fixed_noise_information(H, np.eye(2)[None], modulation, 1.0)
    assert value[0] == pytest.approx(exact, abs=5e-3)


@given(
    st.integers(0, 10_000),
    st.sampled_from([("bpsk", 1), ("bpsk", 3), ("qpsk", 2), ("8psk", 1), ("16qam", 1)]),
    st.floats(-3.0, 3.0),
)
def test_between_the_cutoff_rate_and_all_bits(seed: int, case: tuple[str, int], log: float) -> None:
    modulation, antennas = case
    H, P = np.exp(log) * drawn(seed, 4, 2, antennas), drawn(seed + 1, 1, antennas, antennas)
    classes = difference_classes(modulation, antennas)
    mean = fixed_noise_information(H, P, modulation, 1.0).mean()
    assert mean <= classes.bits + 1e-9
    assert mean >= cutoff_rate(H, P, classes, 1.0).mean() - 0.02


def test_only_the_gram_matrix_matters() -> None:
    H, P = drawn(3, 5, 2, 2), drawn(4, 1, 2, 2)
    turn = np.linalg.qr(drawn(5, 5, 2, 2))[0]
    values = [fixed_noise_information(part, P, "qpsk", 2.0) for part in (H, turn @ H)]
    assert values[0] == pytest.approx(values[1], abs=1e-9)
    assert values[0].tobytes() == fixed_noise_information(H, P, "qpsk", 2.0).tobytes()


@pytest.mark.parametrize("modulation", ["bpsk", "qpsk"])
def test_the_errors_give_the_slope(modulation: str) -> None:
    """I-MMSE: dI = 2 Re tr((H^H H P E)^H dP) / (sigma² ln 2)."""
    H, P, change = drawn(6, 1, 8, 2, 2), drawn(7, 1, 1, 2, 2), 1e-4 * drawn(8, 1, 1, 2, 2)
    errors = information_and_errors(H, P, modulation, 3.0).errors
    gradient = 2 * (H.conj().mT @ H @ P @ errors).mean(axis=1) / (3.0 * np.log(2.0))
    up, down = (
        fixed_noise_information(H, P + step, modulation, 3.0).mean() for step in (change, -change)
    )
    slope = np.sum((gradient.conj() * change[:, 0]).real)
    assert slope == pytest.approx((up - down) / 2, rel=0.03)


@pytest.mark.parametrize("draws", [1, 8])
def test_polished_precoders_carry_more(draws: int) -> None:
    H = drawn(9, 6, draws, 2, 2) * np.linspace(0.3, 2, 6)[:, None, None, None]
    P = best_information_precoders(H, 1.5, "qpsk", 1.0)
    assert np.sum(np.abs(P) ** 2, axis=(1, 2)) == pytest.approx(np.full(6, 1.5))

    def carried(P: Complex) -> Any:
        return fixed_noise_information(H, P[:, None], "qpsk", 1.0).mean(axis=1)

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
    assert fixed_noise_information(H, P[None], "qpsk", 1.0)[0] > 1.63


def test_no_search_beats_the_closed_form_of_bpsk() -> None:
    H = np.exp(np.linspace(-2, 1.5, 8))[:, None, None, None] * np.diag([1.0, 0.6])
    closed = best_information_precoders(H, 1.0, "bpsk", 1.0)
    found = best_information_precoders(H, 1.0, "bpsk", 1.0, start=drawn(10, 8, 2, 2))
    carried = [fixed_noise_information(H, P[:, None], "bpsk", 1.0)[:, 0] for P in (closed, found)]
    assert (carried[0] >= carried[1] - 2e-3).all()


def test_too_many_inputs_are_refused() -> None:
    with pytest.raises(InputError, match=r"16777216 input vectors"):
        fixed_noise_information(np.eye(4)[None], np.eye(4)[None], "64qam", 1.0)
