from collections.abc import Callable

import numpy as np
import pytest
from closed_forms import bpsk_two_antennas_rate, log_sum, mean_log_sum
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from faao_mav.arrays import Complex, Real, RealOrComplex
from faao_mav.errors import InputError
from faao_mav.radio import precoder_search
from faao_mav.radio.best_precoder import (
    BestPrecoders,
    best_mean_precoders,
    best_precoders,
)
from faao_mav.radio.class_sum import ClassSum
from faao_mav.radio.constellation import difference_classes
from faao_mav.radio.precoder import SCHEMES
from faao_mav.radio.precoder_objective import (
    Objective,
    evaluate,
    to_complex,
    to_real,
    value,
)
from faao_mav.radio.precoder_search import minimise, search
from faao_mav.radio.rate import cutoff_rate

SETTINGS = settings(max_examples=15, deadline=None, derandomize=True)
SEEDS = st.integers(0, 2**32 - 1)
TABLE = np.array([[2.0, 1.0], [1.0, 1.0]]) * np.sqrt(0.5)


def gaussian(seed: int, *shape: int) -> Complex:
    parts = np.random.default_rng(seed).standard_normal((2, *shape))
    return np.asarray((parts[0] + 1j * parts[1]) * np.sqrt(0.5))


def unitary(seed: int, size: int) -> Complex:
    return np.linalg.qr(gaussian(seed, size, size))[0]


def power_of(P: Complex) -> Real:
    return np.asarray(np.sum(np.abs(P) ** 2, axis=(-2, -1)))


def check(
    best: BestPrecoders, H: RealOrComplex, W: float, modulation: str, noise: float = 1.0
) -> None:
    """What is returned agrees with itself and with the functions of ``rate``."""
    np.testing.assert_allclose(power_of(best.P), W, rtol=1e-12)
    classes = difference_classes(modulation, H.shape[-1])
    np.testing.assert_allclose(best.rate, cutoff_rate(H, best.P, classes, noise), rtol=1e-12)


@SETTINGS
@given(
    seed=SEEDS,
    case=st.sampled_from(
        [("bpsk", 3, 2), ("qpsk", 2, 1), ("qpsk", 2, 2), ("8psk", 2, 2), ("16qam", 2, 2)]
    ),
    draws=st.integers(1, 3),
    snr=st.floats(0.03, 30.0),
)
def test_derivatives(seed: int, case: tuple[str, int, int], draws: int, snr: float) -> None:
    modulation, transmit, rows = case
    sums = ClassSum(difference_classes(modulation, transmit))
    A = gaussian(seed, 1, draws, rows, rows)
    G = snr * np.conj(np.swapaxes(A, -1, -2)) @ A
    Q = gaussian(seed + 1, 1, rows, transmit)
    Q /= np.linalg.norm(Q)
    at, x, h = evaluate(sums, G, Q), to_real(Q), 1e-5
    np.testing.assert_allclose(at.value, value(sums, G, Q), rtol=1e-12)
    for i in range(x.shape[1]):
        ends = [
            evaluate(sums, G, to_complex(x + sign * h * np.eye(x.shape[1])[i], transmit))
            for sign in (1.0, -1.0)
        ]
        slope = (ends[0].value - ends[1].value) / (2.0 * h)
        row = (ends[0].gradient - ends[1].gradient) / (2.0 * h)
        scale = float(np.linalg.norm(at.gradient))
        np.testing.assert_allclose(slope, at.gradient[:, i], rtol=1e-6, atol=1e-6 * scale)
        scale = float(np.linalg.norm(at.hessian))
        np.testing.assert_allclose(row, at.hessian[:, i], rtol=1e-5, atol=1e-6 * scale)


def test_value_is_the_logarithm_of_the_mean_deficit() -> None:
    H, P, classes = gaussian(0, 5, 2, 2), gaussian(1, 2, 2), difference_classes("qpsk", 2)
    G = (np.conj(np.swapaxes(H, -1, -2)) @ H / 4.0)[None]
    deficit = (classes.bits - cutoff_rate(H, P, classes, 1.0)) * np.log(2.0)
    np.testing.assert_allclose(value(ClassSum(classes), G, P[None]), np.log(np.mean(deficit)))


def test_many_classes_are_summed_in_blocks() -> None:
    H, P = gaussian(2, 70, 2, 2), gaussian(3, 70, 2, 2)
    G = (np.conj(np.swapaxes(H, -1, -2)) @ H / 4.0)[:, None]
    s = log_sum(H, P, "64qam")
    expected = np.log(np.log1p(np.exp(s)))
    sums = ClassSum(difference_classes("64qam", 2))
    np.testing.assert_allclose(value(sums, G, P), expected, rtol=1e-10)
    np.testing.assert_allclose(evaluate(sums, G, P).value, expected, rtol=1e-10)


@SETTINGS
@given(seed=SEEDS, snr=st.floats(0.01, 100.0))
def test_search_reaches_the_closed_form(seed: int, snr: float) -> None:
    H, classes = gaussian(seed, 8, 2, 2), difference_classes("bpsk", 2)
    P = search(H[:, None] * np.sqrt(snr) / 2.0, classes, 1e-9, None)
    expected = bpsk_two_antennas_rate(H, snr, 1.0)
    P *= np.sqrt(snr / power_of(P))[:, None, None]
    np.testing.assert_allclose(cutoff_rate(H, P, classes, 1.0), expected, rtol=1e-6)


@pytest.mark.figures
@pytest.mark.parametrize(("snr_db", "rate"), [(0, 2.2761), (5, 3.5514), (10, 3.9964)])
def test_known_qpsk_rates(snr_db: float, rate: float) -> None:
    H = TABLE * 10.0 ** (snr_db / 20.0)
    best = best_precoders(H, 2.0, "qpsk", 1.0)
    assert not best.exact
    assert best.P.shape == (2, 2)
    assert best.rate == pytest.approx(rate, abs=6e-5)
    check(best, H, 2.0, "qpsk")


def test_closed_forms() -> None:
    H = gaussian(4, 3, 5, 2, 2)
    best = best_precoders(H, 3.0, "bpsk", 0.5)
    assert best.exact
    np.testing.assert_allclose(best.rate, bpsk_two_antennas_rate(H, 3.0, 0.5))
    check(best, H, 3.0, "bpsk", 0.5)
    single = best_precoders(H[..., :1], 3.0, "16qam", 0.5)
    assert single.exact
    np.testing.assert_allclose(single.P, np.sqrt(3.0))


@SETTINGS
@given(
    seed=SEEDS,
    modulation=st.sampled_from(["bpsk", "qpsk", "8psk", "16qam"]),
    shape=st.tuples(st.integers(1, 3), st.integers(1, 3)),
    snr_db=st.floats(-20.0, 20.0),
    tilt=st.floats(0.0, 1.0),
)
def test_never_below_the_classical_schemes(
    seed: int, modulation: str, shape: tuple[int, int], snr_db: float, tilt: float
) -> None:
    assume(shape[1] < 3 or modulation in ("bpsk", "qpsk"))
    line_of_sight = gaussian(seed + 1, 3, shape[0], 1) @ gaussian(seed + 2, 3, 1, shape[1])
    H = tilt * gaussian(seed, 3, *shape) + (1.0 - tilt) * line_of_sight
    W = 10.0 ** (snr_db / 10.0)
    best = best_precoders(H, W, modulation, 1.0)
    check(best, H, W, modulation)
    classes = difference_classes(modulation, shape[1])
    others = [scheme(H, W, 1.0) for scheme in SCHEMES.values()]
    for P in [*others, np.eye(shape[1]) * np.sqrt(W / shape[1])]:
        assert np.all(best.rate >= cutoff_rate(H, P, classes, 1.0) * (1.0 - 1e-6) - 1e-14)


def multistart(H: Complex, W: float, modulation: str, seed: int) -> float:
    """The least log-sum of 15 searches by a general optimiser from random points."""
    N = H.shape[-1]

    def objective(x: Real) -> float:
        P = to_complex(x, N)
        return float(log_sum(H, P * np.sqrt(W / power_of(P)), modulation))

    points = np.random.default_rng(seed).standard_normal((15, 2 * N * N))
    return min(float(minimize(objective, x, method="BFGS").fun) for x in points)


@pytest.mark.parametrize(
    ("modulation", "W", "seed"),
    [("qpsk", 1.0, 1), ("qpsk", 4.0, 2), ("qpsk", 12.0, 3), ("8psk", 8.0, 4), ("16qam", 5.0, 5)],
)
def test_as_good_as_many_random_starts(modulation: str, W: float, seed: int) -> None:
    H = gaussian(seed, 2, 2)
    found = float(log_sum(H, best_precoders(H, W, modulation, 1.0).P, modulation))
    reached = multistart(H, W, modulation, seed)
    bits = difference_classes(modulation, 2).bits
    rates = [bits - float(np.logaddexp(0.0, s)) / np.log(2.0) for s in (found, reached)]
    assert rates[0] >= rates[1] * (1.0 - 1e-3)
    assert found < reached + 1e-3


@SETTINGS
@given(seed=SEEDS, modulation=st.sampled_from(["qpsk", "8psk"]), W=st.floats(0.01, 10.0))
def test_rate_depends_on_singular_values_only(seed: int, modulation: str, W: float) -> None:
    H = gaussian(seed, 2, 2)
    best = best_precoders(H, W, modulation, 1.0)
    turned = unitary(seed + 1, 2) @ H @ unitary(seed + 2, 2)
    rate = best_precoders(turned, W, modulation, 1.0).rate
    np.testing.assert_allclose(rate, best.rate, rtol=1e-5)


@pytest.mark.parametrize("factor", [1e-7, 1e5])
def test_scale_of_channel_and_noise_is_free(factor: float) -> None:
    H = gaussian(6, 5, 2, 2)
    best = best_precoders(H, 2.0, "qpsk", 1.0)
    scaled = best_precoders(factor * H, 2.0, "qpsk", factor**2)
    np.testing.assert_allclose(scaled.rate, best.rate, rtol=1e-6)


@pytest.mark.parametrize(("modulation", "levels"), [("bpsk", "qpsk"), ("qpsk", "16qam")])
def test_one_mode_carries_a_superposition(modulation: str, levels: str) -> None:
    """Two streams on one mode reach at least what their superposed square alphabet does."""
    H = np.array([[1.0 + 1j, 2.0], [2.0 + 2j, 4.0]])
    best = best_precoders(H, 3.0, modulation, 1.0)
    gain = np.linalg.svd(H, compute_uv=False)[0]
    scalar = cutoff_rate(
        gain * np.eye(1), np.sqrt(3.0) * np.eye(1), difference_classes(levels, 1), 1.0
    )
    assert best.rate >= scalar * (1.0 - 1e-6)
    # next to nothing is sent where the channel leads nowhere
    assert np.linalg.svd(best.P, compute_uv=False)[1] ** 2 < 1e-6 * 3.0


def test_rate_rises_smoothly_with_the_gain_of_one_mode() -> None:
    """Many shallow optima here; a slot stuck in a worse one would fall out of line."""
    gains = np.sqrt(10.0 ** np.linspace(0.4, 2.1, 60))
    H = gains[:, None, None] * np.array([[0.6, 0.8j]])
    rate = best_precoders(H, 1.0, "16qam", 1.0).rate
    assert np.all(np.diff(rate) > 0.0)
    assert np.max(np.abs(np.diff(rate, 2))) < 0.01
    alone = [float(best_precoders(one, 1.0, "16qam", 1.0).rate) for one in H[10::20]]
    np.testing.assert_allclose(alone, rate[10::20], rtol=2e-3)


@pytest.mark.parametrize("shape", [(1, 2), (3, 2), (1, 3), (2, 3), (4, 2)])
def test_unequal_antenna_numbers(shape: tuple[int, int]) -> None:
    H = gaussian(7, 4, *shape)
    best = best_precoders(H, 2.0, "qpsk", 1.0)
    check(best, H, 2.0, "qpsk")
    # a receiving antenna that hears nothing changes nothing
    silent = np.concatenate([H, np.zeros_like(H[:, :1])], axis=1)
    np.testing.assert_allclose(best_precoders(silent, 2.0, "qpsk", 1.0).rate, best.rate, rtol=1e-5)


def test_zero_channel() -> None:
    H = np.stack([np.zeros((2, 2)), np.eye(2)])
    best = best_precoders(H, 2.0, "qpsk", 1.0)
    check(best, H, 2.0, "qpsk")
    np.testing.assert_allclose(best.P[0], np.eye(2))
    again = best_precoders(H, 2.0, "qpsk", 1.0, start=best.P)
    np.testing.assert_allclose(again.P[0], np.eye(2))
    assert best_mean_precoders(0.0 * H, 2.0, "qpsk", 1.0).rate == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("modulation", ["bpsk", "qpsk", "16qam"])
@pytest.mark.parametrize("snr", [1e-12, 1e-9, 1e-5, 1e4, 1e9])
def test_extremes(modulation: str, snr: float) -> None:
    H = gaussian(8, 4, 2, 2)
    best = best_precoders(H, snr, modulation, 1.0)
    check(best, H, snr, modulation)
    reached = log_sum(H, best.P, modulation)
    assert np.all(np.isfinite(reached))
    largest = np.linalg.svd(H, compute_uv=False)[:, 0]
    if snr < 1e-4:  # all on the strongest mode: R_0 = mean of D / ln 2, E||H P u||² = 2 λ² W
        expected = snr * largest**2 / 2.0 / np.log(2.0)
        np.testing.assert_allclose(best.rate, expected, rtol=1e-4)
    again = best_precoders(H, snr, modulation, 1.0, start=best.P)
    assert np.all(log_sum(H, again.P, modulation) <= reached + 1e-9 * np.abs(reached))
    draws = best_mean_precoders(H, snr, modulation, 1.0)
    assert np.isfinite(mean_log_sum(H, draws.P, modulation))
    assert 0.0 <= draws.rate <= difference_classes(modulation, 2).bits


def test_saturated_links_approach_the_largest_least_distance() -> None:
    H = gaussian(9, 6, 2, 2)
    per_watt = [-log_sum(H, best_precoders(H, W, "qpsk", 1.0).P, "qpsk") / W for W in (1e4, 1e7)]
    np.testing.assert_allclose(per_watt[0], per_watt[1], rtol=5e-3)
    # one precoder that does so by construction: two streams on one mode as 16-QAM
    largest = np.linalg.svd(H, compute_uv=False)[:, 0]
    assert np.all(per_watt[1] >= 0.99 * largest**2 * 0.4 / 4.0)


@SETTINGS
@given(seed=SEEDS, snr_db=st.floats(-60.0, 60.0), modulation=st.sampled_from(["qpsk", "8psk"]))
def test_warm_start_is_never_worse(seed: int, snr_db: float, modulation: str) -> None:
    H, start, W = gaussian(seed, 4, 2, 2), gaussian(seed + 1, 4, 2, 2), 10.0 ** (snr_db / 10.0)
    best = best_precoders(H, W, modulation, 1.0, start=start)
    check(best, H, W, modulation)
    before = log_sum(H, start * np.sqrt(W / power_of(start))[:, None, None], modulation)
    after = log_sum(H, best.P, modulation)
    assert np.all(after <= before + 1e-11 * np.maximum(1.0, np.abs(before)))


def test_warm_start_takes_few_evaluations(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = []

    def evaluate_and_count(sums: ClassSum, G: Complex, Q: Complex) -> Objective:
        counted.append(len(Q))
        return evaluate(sums, G, Q)

    def evaluations(A: Complex, start: Complex | None) -> int:
        counted.clear()
        search(A, classes, 1e-6, start)
        return sum(counted)

    monkeypatch.setattr(precoder_search, "evaluate", evaluate_and_count)
    classes = difference_classes("qpsk", 2)
    A = gaussian(10, 50, 1, 2, 2)
    P = search(A, classes, 1e-6, None)
    nearby = evaluations(1.02 * A, P)
    assert evaluations(A, P) < 1.5 * len(A)
    assert nearby < 5 * len(A)
    assert evaluations(A, None) > 10 * nearby


def test_start_outside_the_channel() -> None:
    """A start that reaches nobody is replaced, not divided by zero."""
    H = np.array([[1.0, 0.0]])
    best = best_precoders(H, 2.0, "qpsk", 1.0, start=np.array([[0.0, 0.0], [1.0, 1.0]]))
    check(best, H, 2.0, "qpsk")
    assert best.rate > 0.5


def test_minimise_never_climbs() -> None:
    sums = ClassSum(difference_classes("8psk", 2))
    A, Q = gaussian(11, 20, 2, 2, 2) * 4.0, gaussian(12, 20, 2, 2)
    G = np.conj(np.swapaxes(A, -1, -2)) @ A
    start = Q / np.linalg.norm(Q, axis=(-2, -1), keepdims=True)
    found, F = minimise(sums, G, start, 1e-6)
    np.testing.assert_allclose(F, value(sums, G, found), rtol=1e-12)
    assert np.all(F <= value(sums, G, start))


@pytest.mark.parametrize("modulation", ["bpsk", "qpsk"])
def test_mean_of_one_draw_or_of_equal_draws(modulation: str) -> None:
    H = gaussian(13, 6, 2, 2)
    single = best_precoders(H, 2.0, modulation, 1.0)
    one = best_mean_precoders(H[:, None], 2.0, modulation, 1.0)
    np.testing.assert_array_equal(one.P, single.P)
    equal = best_mean_precoders(np.repeat(H[:, None], 4, axis=1), 2.0, modulation, 1.0)
    assert not equal.exact
    np.testing.assert_allclose(equal.rate, single.rate, rtol=1e-5)
    reached = mean_log_sum(np.repeat(H[:, None], 4, axis=1), equal.P, modulation)
    np.testing.assert_allclose(reached, log_sum(H, single.P, modulation), rtol=1e-4)


def rician(seed: int, K: float) -> tuple[Complex, Complex]:
    los = np.array([[1.0, 1.0], [1.0, np.exp(0.7j)]])
    fading = gaussian(seed, 5, 32, 2, 2)
    return los, np.sqrt(K / (K + 1.0)) * los + np.sqrt(1.0 / (K + 1.0)) * fading


@pytest.mark.parametrize("modulation", ["bpsk", "qpsk"])
@pytest.mark.parametrize("W", [0.3, 3.0, 30.0])
def test_mean_beats_the_precoder_of_the_line_of_sight(modulation: str, W: float) -> None:
    los, draws = rician(14, 3.0)
    best = best_mean_precoders(draws, W, modulation, 1.0)
    np.testing.assert_allclose(power_of(best.P), W, rtol=1e-12)
    classes = difference_classes(modulation, 2)

    def mean(P: Complex) -> Real:
        return np.asarray(np.mean(cutoff_rate(draws, P, classes, 1.0), axis=1))

    np.testing.assert_allclose(best.rate, mean(best.P[:, None]), rtol=1e-12)
    bits = classes.bits - np.logaddexp(0.0, mean_log_sum(draws, best.P, modulation)) / np.log(2.0)
    np.testing.assert_allclose(best.rate, bits, rtol=1e-9)
    known = best_precoders(los, W, modulation, 1.0).P
    for P in (known, np.eye(2) * np.sqrt(W / 2.0)):
        assert np.all(best.rate >= mean(P) * (1.0 - 1e-7))
    assert np.mean(best.rate) > np.mean(mean(known))
    # but not the precoders of somebody who knows the fading
    assert np.all(best.rate <= np.mean(best_precoders(draws, W, modulation, 1.0).rate, axis=1))
    warm = best_mean_precoders(draws, W, modulation, 1.0, start=best.P)
    assert np.all(warm.rate >= best.rate * (1.0 - 1e-12))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: best_precoders(np.eye(2), 0.0, "qpsk", 1.0), "power"),
        (lambda: best_precoders(np.eye(2), 1.0, "qpsk", 0.0), "noise"),
        (lambda: best_precoders(np.eye(2), 1.0, "pam", 1.0), "modulation"),
        (lambda: best_precoders(np.eye(2) * np.nan, 1.0, "qpsk", 1.0), "finite"),
        (lambda: best_precoders(np.ones(2), 1.0, "qpsk", 1.0), "axes"),
        (lambda: best_mean_precoders(np.eye(2), 1.0, "qpsk", 1.0), "axes"),
        (lambda: best_precoders(np.eye(2), 1.0, "qpsk", 1.0, start=np.ones((3, 2, 2))), "start"),
    ],
)
def test_unusable_input(call: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()


def test_no_channels() -> None:
    best = best_precoders(np.empty((0, 2, 2)), 1.0, "qpsk", 1.0)
    assert best.P.shape == (0, 2, 2)
    assert best.rate.shape == (0,)
