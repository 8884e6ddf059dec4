"""Alphabets and the cutoff rate: published values, the equation as printed, a radio's own steps."""

import numpy as np
import pytest
from closed_forms import channel
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.errors import InputError
from faao_mav.radio import rate
from faao_mav.radio.constellation import (
    MODULATIONS,
    constellation,
    coordinates,
    difference_classes,
    difference_vector_count,
    features,
    symbol_vectors,
)
from faao_mav.radio.mutual_information import mutual_information
from faao_mav.radio.precoder import bpsk_two_antennas
from faao_mav.radio.rate import SquareSum, cutoff_rate, exponents
from faao_mav.radio.rate_steps import RateSteps, one_stream

# Every case whose rho^{2N} pairs can be gone through one by one in about a second.
SMALL = [
    (m, n) for m in MODULATIONS for n in (1, 2, 3) if len(constellation(m)) ** (2 * n) <= 300_000
]


# The table's SNR is per stream with H divided by √2: unit noise, H = [2 1; 1 1] √(snr/2), and
# P = I, so tr(P^H P) = W = 2. The closed form is scaled to the same W = 2.
@pytest.mark.figures
def test_two_antenna_oracles() -> None:
    for modulation, closed_form, decibels, cutoff, information in (
        ("bpsk", False, -5, 0.5813, 0.8457),
        ("bpsk", False, 5, 1.8039, 1.9057),
        ("qpsk", False, 0, 1.5944, 2.1662),
        ("qpsk", False, 10, 3.8653, 3.9444),
        ("bpsk", True, -5, 1.1591, 1.4958),
        ("bpsk", True, 5, 1.9999, 2.0000),
    ):
        H = np.array([[[2.0, 1.0], [1.0, 1.0]]]) * np.sqrt(10 ** (decibels / 10) / 2)
        P = bpsk_two_antennas(H, 2.0) if closed_form else np.eye(2)[None]
        assert cutoff_rate(H, P, modulation, 1.0)[0] == pytest.approx(cutoff, abs=5.1e-5)
        found = mutual_information(H, P, modulation, 1.0)
        assert found[0] == pytest.approx(information, abs=0.01)


@pytest.mark.parametrize(("modulation", "antennas"), SMALL)
def test_equation_7_as_printed(modulation: str, antennas: int) -> None:
    H, P = channel(3, 2, antennas), channel(4, antennas, antennas)
    x = symbol_vectors(modulation, antennas)
    y = x @ (H @ P).T
    total = sum(np.exp(-np.sum(np.abs(s - y) ** 2, axis=1) / (4 * 0.2)).sum() for s in y)
    classes = difference_classes(modulation, antennas)
    expected = 2 * classes.bits - np.log2(total)
    assert cutoff_rate(H, P, modulation, 0.2) == pytest.approx(expected, abs=1e-11)


@pytest.mark.parametrize("antennas", [2, 3])
def test_sums_over_all_differences(antennas: int, monkeypatch: pytest.MonkeyPatch) -> None:
    A = channel(5, 9, 3, antennas) * np.sqrt(2.0)
    A *= np.array([0.05, 0.3, 1.0] * 3)[:, None, None]
    A[1, :, 0] = 0.0  # a stream without power
    A[2, :, 0] *= 1e-9
    A[3] = A[3, :, :1] * (1.0 + np.arange(antennas))  # all streams on one mode
    A[4] = 0.0
    A[5] *= 1e-160
    A[6, :, -1] *= 30.0
    Z = A.conj().mT @ A
    classes = difference_classes("16qam", antennas)
    u, share = classes.vectors, classes.multiplicity / classes.symbols
    D = [np.sum(np.conj(u) * (u @ z.T), axis=1).real for z in Z]
    expected = share * np.exp(-np.array(D)) @ np.column_stack([np.ones(len(u)), features(u)])
    sums = SquareSum(classes)
    scale = np.abs(expected).max(axis=1, keepdims=True)
    for block in (1, 1 << 18):
        monkeypatch.setattr(rate, "CACHE", block)
        found = sums.sums(coordinates(Z))
        np.testing.assert_allclose(found / scale, expected / scale, rtol=1e-9, atol=1e-10)


def test_classes_hold_every_pair() -> None:
    for modulation, antennas, count in (
        ("bpsk", 2, 4),
        ("qpsk", 2, 20),
        ("8psk", 2, 136),
        ("16qam", 2, 574),
        ("bpsk", 4, 40),
        ("qpsk", 3, 182),
    ):
        assert len(difference_classes(modulation, antennas).vectors) == count
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


def test_extended_precision_reference() -> None:
    classes, H, P = difference_classes("8psk", 2), channel(9, 2, 2), np.eye(2)
    for snr in (1e-3, 1.0, 30.0, 100.0):
        D = exponents(H, P, classes.vectors, 1.0 / snr).astype(np.longdouble)
        total = np.sum(classes.multiplicity * np.exp(-D)) / np.longdouble(classes.symbols)
        expected = float(np.log2(np.longdouble(classes.symbols)) - np.log1p(total) / np.log(2.0))
        assert cutoff_rate(H, P, "8psk", 1.0 / snr) == pytest.approx(expected, abs=1e-13)
    for noise in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="noise"):
            exponents(np.eye(1), np.eye(1), np.ones((1, 1)), noise)


ROWS = st.lists(st.tuples(st.floats(-20, 40), st.floats(0.01, 10)), min_size=1, max_size=12)
SNR = 10 ** np.linspace(-4, 6, 2001)


@given(ROWS, st.floats(0.1, 8))
def test_steps_and_what_rises_about_them(rows: list[tuple[float, float]], width: float) -> None:
    snr_db, rates = zip(*rows, strict=True)
    steps = RateSteps.of(snr_db, rates)
    value = steps.value(SNR)
    for snr, had_there in zip(SNR[::50], value[::50], strict=True):
        had = [r for s, r in rows if s <= 10 * np.log10(snr)]
        assert had_there == max(had, default=0.0)
    assert steps.most == max(rates)
    smooth, above = steps.widened(width).value(SNR), steps.widened(width, above=True).value(SNR)
    assert (np.diff(smooth) >= -1e-12).all()
    assert (above >= value - 1e-12).all()
    step = np.diff(np.log10(SNR))[0] * 10
    sums = [float(np.sum(each) * step) for each in (smooth, value)]  # one mean over a sweep
    assert sums[0] == pytest.approx(sums[1], abs=2 * step * steps.most)


@given(st.integers(1, 4), st.integers(1, 4), st.integers(1, 3), st.integers(0, 2**31))
def test_no_stream_is_stronger(receive: int, transmit: int, draws: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = (draws, receive, transmit)
    H = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
    P = one_stream(H, 4.0)
    assert np.sum(np.abs(P) ** 2) == pytest.approx(4.0)
    assert not P[:, 1:].any()
    others = rng.standard_normal((50, transmit, 1)) + 1j * rng.standard_normal((50, transmit, 1))
    others *= 2 / np.linalg.norm(others, axis=1, keepdims=True)
    gains = np.sum(np.abs(H @ others[:, None]) ** 2, axis=(-2, -1)).mean(axis=-1)
    assert np.sum(np.abs(H @ P) ** 2, axis=(-2, -1)).mean() >= gains.max() * (1 - 1e-9)
