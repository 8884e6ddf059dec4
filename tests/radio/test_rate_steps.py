"""A radio's own rates: steps over the SNR, and the one stream that has them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.radio.rate_steps import RateSteps, one_stream

ROWS = st.lists(st.tuples(st.floats(-20, 40), st.floats(0.01, 10)), min_size=1, max_size=12)
SNR = 10 ** np.linspace(-4, 6, 2001)


@given(ROWS, st.floats(0.1, 8))
def test_steps_and_what_rises_about_them(rows: list[tuple[float, float]], width: float) -> None:
    snr_db, rates = zip(*rows, strict=True)
    steps = RateSteps.of(snr_db, rates)
    value = steps.value(SNR)
    for snr, rate in zip(SNR[::50], value[::50], strict=True):
        had = [r for s, r in rows if s <= 10 * np.log10(snr)]
        assert rate == max(had, default=0.0)
    assert steps.most == max(rates)
    smooth, above = steps.widened(width).value(SNR), steps.above(width).value(SNR)
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
