"""The precoders of highest rate: closed forms, classical schemes, other searches, extremes."""

from itertools import product

import numpy as np
import pytest
from closed_forms import bpsk_two_antennas_rate, channel, power_of
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from faao_mav.arrays import Complex, Real, RealOrComplex
from faao_mav.errors import InputError
from faao_mav.radio.best_precoder import best_precoders
from faao_mav.radio.constellation import difference_classes
from faao_mav.radio.mutual_information import mutual_information
from faao_mav.radio.precoder import SCHEMES
from faao_mav.radio.rate import Measure, cutoff_rate

SETTINGS = settings(max_examples=10)
SEEDS = st.integers(0, 2**32 - 1)
RATES = {"cutoff": cutoff_rate, "mutual_information": mutual_information}
TABLE = np.array([[2.0, 1.0], [1.0, 1.0]]) * np.sqrt(0.5)


def best(
    H: RealOrComplex, W: float, modulation: str, start: RealOrComplex | None = None
) -> tuple[Complex, Real]:
    """The best precoders of single channels (..., N_r, N_t), of power W, and their cutoff rates."""
    P = best_precoders(H[..., None, :, :], W, modulation, 1.0, start=start)
    np.testing.assert_allclose(power_of(P), W, rtol=1e-12)
    return P, cutoff_rate(H, P, modulation, 1.0)


@pytest.mark.parametrize(
    ("measure", "modulation", "draws"), [("cutoff", "8psk", 2), ("mutual_information", "qpsk", 1)]
)
def test_no_other_precoder_near_it_is_better(measure: Measure, modulation: str, draws: int) -> None:
    H = channel(3, 2, draws, 2, 2)
    P = best_precoders(H, 3.0, modulation, 1.0, measure=measure)

    def rate(P: Complex) -> Real:
        return np.asarray(RATES[measure](H, P[:, None], modulation, 1.0).mean(axis=1))

    for seed in range(10):
        other = P + 0.02 * channel(seed, 2, 2, 2)
        other *= np.sqrt(3.0 / power_of(other))[:, None, None]
        # the slope of the mutual information at so many noises is nearly that of its value
        assert np.all(rate(other) < rate(P) + (1e-5 if measure == "cutoff" else 2e-3))


@SETTINGS
@given(seed=SEEDS, snr=st.floats(0.01, 100.0), receive=st.integers(1, 3))
def test_closed_forms(seed: int, snr: float, receive: int) -> None:
    H = channel(seed, 4, receive, 2)
    _, rate = best(H, snr, "bpsk")
    np.testing.assert_allclose(rate, bpsk_two_antennas_rate(H, snr, 1.0), rtol=1e-9)
    searched = best_precoders(np.stack([H, H], axis=1), snr, "bpsk", 1.0)
    found = cutoff_rate(H, searched, "bpsk", 1.0)
    np.testing.assert_allclose(found, rate, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(best(H[..., :1], snr, "16qam")[0], np.sqrt(snr))


@pytest.mark.figures
def test_known_qpsk_rates() -> None:
    for snr_db, expected in ((0, 2.2761), (5, 3.5514), (10, 3.9964)):
        _, rate = best(TABLE * 10.0 ** (snr_db / 20.0), 2.0, "qpsk")
        assert rate == pytest.approx(expected, abs=6e-5)
    # at -5 dB 1.6376 bit on one mode, 1.4958 on those of the highest cutoff rate
    H = TABLE[None] * 10**-0.25
    P = best_precoders(H, 2.0, "qpsk", 1.0, measure="mutual_information")
    assert mutual_information(H, P[None], "qpsk", 1.0)[0] > 1.63


@SETTINGS
@given(
    seed=SEEDS,
    modulation=st.sampled_from(["bpsk", "qpsk", "8psk", "16qam"]),
    shape=st.tuples(st.integers(1, 4), st.integers(1, 3)),
    snr_db=st.floats(-20.0, 20.0),
    tilt=st.floats(0.0, 1.0),
)
def test_never_below_the_classical_schemes(
    seed: int, modulation: str, shape: tuple[int, int], snr_db: float, tilt: float
) -> None:
    assume(shape[1] < 3 or modulation in ("bpsk", "qpsk"))
    line_of_sight = channel(seed + 1, 3, shape[0], 1) @ channel(seed + 2, 3, 1, shape[1])
    H = tilt * channel(seed, 3, *shape) + (1.0 - tilt) * line_of_sight
    W = 10.0 ** (snr_db / 10.0)
    _, rate = best(H, W, modulation)
    others = [scheme(H, W, 1.0) for scheme in SCHEMES.values()]
    for P in [*others, np.eye(shape[1]) * np.sqrt(W / shape[1])]:
        assert np.all(rate >= cutoff_rate(H, P, modulation, 1.0) - 1e-6)


def test_extremes() -> None:
    H = channel(8, 4, 2, 2)
    largest = np.linalg.svd(H, compute_uv=False)[:, 0]
    for modulation, snr in product(("bpsk", "qpsk", "16qam"), (1e-12, 1e-5, 1e4, 1e9)):
        P, rate = best(H, snr, modulation)
        assert np.all(np.isfinite(P))
        if snr < 1e-4:  # all on the strongest mode: R_0 = mean of D / ln 2, E||H P u||² = 2 λ² W
            expected = snr * largest**2 / 2.0 / np.log(2.0)
            np.testing.assert_allclose(rate, expected, rtol=1e-4, atol=1e-14)
        else:
            np.testing.assert_allclose(rate, difference_classes(modulation, 2).bits, atol=1e-6)
        assert np.all(np.isfinite(best_precoders(H[None], snr, modulation, 1.0)))


def test_channels_that_lead_nowhere() -> None:
    dark = np.stack([np.zeros((2, 2)), np.eye(2)]).astype(np.complex128)
    P, _ = best(dark, 2.0, "qpsk")
    assert P[0] == pytest.approx(np.eye(2))
    assert best(dark, 2.0, "qpsk", start=P)[0][0] == pytest.approx(np.eye(2))
    assert best_precoders(np.empty((0, 1, 2, 2)), 1.0, "qpsk", 1.0).shape == (0, 2, 2)
    # a start that reaches nobody is replaced, not divided by zero
    _, rate = best(np.array([[1.0, 0.0]]), 2.0, "qpsk", start=np.array([[0.0, 0.0], [1.0, 1.0]]))
    assert rate > 0.5
    # a receiving antenna that hears nothing changes nothing
    H = channel(7, 4, 1, 2)
    silent = np.concatenate([H, np.zeros_like(H)], axis=1)
    np.testing.assert_allclose(best(silent, 2.0, "qpsk")[1], best(H, 2.0, "qpsk")[1], rtol=1e-5)


def test_unusable_input() -> None:
    for power, noise, modulation, message in (
        (0.0, 1.0, "qpsk", "power"),
        (1.0, 0.0, "qpsk", "noise"),
        (1.0, 1.0, "pam", "modulation"),
    ):
        with pytest.raises(InputError, match=message):
            best_precoders(np.eye(2)[None], power, modulation, noise)


@SETTINGS
@given(
    seed=SEEDS,
    snr_db=st.floats(-60.0, 60.0),
    modulation=st.sampled_from(["qpsk", "8psk"]),
    measure=st.sampled_from(["cutoff", "mutual_information"]),
)
def test_a_start_is_never_worse(
    seed: int, snr_db: float, modulation: str, measure: Measure
) -> None:
    W = 10.0 ** (snr_db / 10.0)
    H, start = channel(seed, 4, 2, 2, 2), channel(seed + 1, 4, 2, 2)
    start *= np.sqrt(W / power_of(start))[:, None, None]
    P = best_precoders(H, W, modulation, 1.0, measure=measure, start=start)
    before, after = (
        RATES[measure](H, M[:, None], modulation, 1.0).mean(axis=1) for M in (start, P)
    )
    assert np.all(after >= before - 1e-12)


@pytest.mark.parametrize(("modulation", "W"), [("bpsk", 0.3), ("qpsk", 3.0), ("qpsk", 30.0)])
def test_one_precoder_for_many_draws(modulation: str, W: float) -> None:
    los = np.array([[1.0, 1.0], [1.0, np.exp(0.7j)]])
    draws = (np.sqrt(3.0) * los + channel(14, 5, 32, 2, 2)) / 2.0

    def mean(P: Complex) -> Real:
        return np.asarray(np.mean(cutoff_rate(draws, P, modulation, 1.0), axis=1))

    rate = mean(best_precoders(draws, W, modulation, 1.0)[:, None])
    known = mean(best(los, W, modulation)[0])
    for other in (known, mean(np.eye(2) * np.sqrt(W / 2.0))):
        assert np.all(rate >= other * (1.0 - 1e-7))
    assert np.mean(rate) > np.mean(known)
    # but not the precoders of somebody who knows the fading
    assert np.all(rate <= np.mean(best(draws, W, modulation)[1], axis=1))
    # nor is one for two draws 60 dB apart below that of the weaker
    draws = np.array([[[[1e3, 1e3]], [[1.0, -1.0j]]]])
    weaker = best_precoders(draws[:, 1:], W, modulation, 1.0)[:, None]
    assert mean(best_precoders(draws, W, modulation, 1.0)[:, None]) > mean(weaker) - 0.01
