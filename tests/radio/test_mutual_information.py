"""The mutual information at fixed noises, beside quadrature, bounds and limits."""

import numpy as np
import pytest
from closed_forms import channel
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.arrays import Complex
from faao_mav.errors import InputError
from faao_mav.radio.constellation import MODULATIONS, difference_classes, symbol_vectors
from faao_mav.radio.mutual_information import mutual_information
from faao_mav.radio.rate import cutoff_rate

ONE = np.ones((1, 1, 1))


def by_hermite(A: Complex, modulation: str, order: int) -> float:
    """(5) as printed for one receiving antenna and unit noise, by Gauss-Hermite quadrature."""
    node, weight = np.polynomial.hermite.hermgauss(order)
    noise = (node[:, None] + 1j * node).ravel()
    weight = np.outer(weight, weight).ravel() / np.pi
    x = symbol_vectors(modulation, A.shape[1])
    y = (x @ A.T)[:, 0]
    loss = 0.0
    for s in y:
        z = np.abs(s - y[:, None] + noise) ** 2 - np.abs(noise) ** 2
        loss += weight @ np.log2(np.sum(np.exp(-z), axis=0)) / len(y)
    return float(np.log2(len(y)) - loss)


@pytest.mark.parametrize("modulation", MODULATIONS)
def test_equation_5_as_printed(modulation: str) -> None:
    antennas = 1 if modulation in ("16qam", "64qam") else 2
    for snr in (0.01, 1.0, 10.0):
        H = np.sqrt(snr) * channel(1, 1, 1, antennas)
        P = np.eye(antennas)[None]
        expected = by_hermite(H[0], modulation, 30 if modulation == "8psk" else 50)
        assert mutual_information(H, P, modulation, 1.0)[0] == pytest.approx(expected, abs=0.01)


@settings(max_examples=20)
@given(
    st.integers(0, 10_000),
    st.sampled_from([("bpsk", 1), ("bpsk", 2), ("bpsk", 3), ("qpsk", 2), ("8psk", 2)]),
    st.integers(1, 3),
    st.integers(1, 5),
    st.floats(-9.0, 5.0),
)
def test_between_cutoff_rate_and_ceilings(
    seed: int, case: tuple[str, int], receive: int, draws: int, exponent: float
) -> None:
    modulation, antennas = case
    H = channel(seed, draws, receive, antennas)
    P = channel(seed + 1, draws, antennas, antennas)
    noise = 10.0**-exponent
    classes = difference_classes(modulation, antennas)
    mean = mutual_information(H, P, modulation, noise).mean()
    gram = np.swapaxes(H @ P, 1, 2).conj() @ (H @ P) / noise
    gaussian = np.linalg.slogdet(np.eye(antennas) + gram)[1].mean() / np.log(2.0)
    slack = 0.02 * min(1.0, gaussian) + 1e-12
    assert cutoff_rate(H, P, modulation, noise).mean() - slack <= mean
    assert mean <= min(classes.bits + 1e-9, gaussian + slack)


def test_extremes() -> None:
    H, eye = np.array([[[1.0, 0.3j], [0.2, 1.0]]]), np.eye(2)[None]
    for modulation in ("bpsk", "8psk", "16qam"):
        bits = difference_classes(modulation, 2).bits
        assert mutual_information(H, eye, modulation, 1e-20)[0] == pytest.approx(bits, abs=1e-6)
        assert mutual_information(0 * H, eye, modulation, 1.0)[0] == pytest.approx(0.0, abs=1e-12)
        # I = E||H x||² / σ² / ln 2 to first order, BPSK as well
        weak = mutual_information(H, eye, modulation, 1e5)[0]
        assert weak == pytest.approx(np.linalg.norm(H) ** 2 / 1e5 / np.log(2.0), rel=0.05)
    with pytest.raises(InputError, match="noise"):
        mutual_information(ONE, ONE, "bpsk", 0.0)


def test_the_errors_give_the_slope() -> None:
    """I-MMSE: dI = 2 Re tr((H^H H P E)^H dP) / (sigma² ln 2)."""
    H, P, change = channel(6, 1, 1, 2, 2), channel(7, 1, 1, 2, 2), 1e-4 * channel(8, 1, 1, 2, 2)
    errors = np.zeros((1, 1, 2, 2), dtype=np.complex128)
    mutual_information(H, P, "qpsk", 0.75, errors=errors)
    gradient = 2 * (H.conj().mT @ H @ P @ errors).mean(axis=1) / (0.75 * np.log(2.0))
    up, down = (mutual_information(H, P + step, "qpsk", 0.75).mean() for step in (change, -change))
    slope = np.sum((gradient.conj() * change[:, 0]).real)
    assert slope == pytest.approx((up - down) / 2, rel=0.03)


def test_the_spread_over_seeds_is_the_error() -> None:
    """Beside many times as many noises; more noises err less."""
    H, eye = np.sqrt(2.0) * channel(4, 32, 2, 2), np.eye(2)[None]
    exact = mutual_information(H, eye, "qpsk", 1.0, nodes=1 << 15).mean()

    def means(nodes: int) -> list[float]:
        every = (mutual_information(H, eye, "qpsk", 1.0, nodes=nodes, seed=k) for k in range(8))
        return [float(found.mean()) for found in every]

    few, many = means(512), means(1 << 13)
    assert abs(np.mean(few) - exact) < 4 * np.std(few, ddof=1) / np.sqrt(8) + 1e-4
    assert np.std(many) < 0.5 * np.std(few) < 0.02
    assert abs(many[0] - exact) < 5e-3
