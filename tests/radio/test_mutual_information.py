import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.arrays import Complex
from faao_mav.errors import InputError
from faao_mav.radio.constellation import MODULATIONS, difference_classes, symbol_vectors
from faao_mav.radio.likelihood import log_ratio, log_ratio_by_parts
from faao_mav.radio.mutual_information import mutual_information, pooled_mutual_information
from faao_mav.radio.noise_average import (
    by_lattice,
    by_quadrature,
    gaussian_controls,
    lattice,
    normal_grid,
)
from faao_mav.radio.precoder import bpsk_two_antennas
from faao_mav.radio.rate import cutoff_rate
from faao_mav.radio.real_channel import real_channel, real_inputs


def channel(seed: int, *shape: int) -> Complex:
    parts = np.random.default_rng(seed).standard_normal((2, *shape))
    return np.asarray((parts[0] + 1j * parts[1]) * np.sqrt(0.5))


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


@pytest.mark.parametrize(
    ("modulation", "decibels", "expected"),
    [("bpsk", 0, 0.721452), ("bpsk", 5, 0.976176), ("qpsk", 0, 0.971888), ("qpsk", 5, 1.718388)],
)
def test_single_antenna_oracle(modulation: str, decibels: float, expected: float) -> None:
    one = np.ones((1, 1, 1))
    estimate = mutual_information(
        one, one, modulation, 10 ** (-decibels / 10), rng=np.random.default_rng(0), tolerance=1e-6
    )
    assert not estimate.random.any()
    assert estimate.value[0] == pytest.approx(expected, abs=1.5e-6)
    assert estimate.error[0] < 1e-6


# As for the cutoff rate: unit noise, H = [2 1; 1 1] √(snr/2), P = I with tr(P^H P) = W = 2.
@pytest.mark.figures
@pytest.mark.parametrize(
    ("modulation", "closed_form", "decibels", "expected"),
    [
        ("bpsk", False, -5, 0.8457),
        ("bpsk", False, 0, 1.4578),
        ("bpsk", False, 5, 1.9057),
        ("qpsk", False, 0, 2.1662),
        ("qpsk", False, 5, 3.3584),
        ("qpsk", False, 10, 3.9444),
        ("bpsk", True, -5, 1.4958),
        ("bpsk", True, 0, 1.9644),
        ("bpsk", True, 5, 2.0000),
    ],
)
def test_two_antenna_oracle(
    modulation: str, closed_form: bool, decibels: float, expected: float
) -> None:
    H = np.array([[[2.0, 1.0], [1.0, 1.0]]]) * np.sqrt(10 ** (decibels / 10) / 2)
    P = bpsk_two_antennas(H, 2.0) if closed_form else np.eye(2)[None]
    estimate = mutual_information(
        H, P, modulation, 1.0, rng=np.random.default_rng(0), tolerance=3e-4
    )
    assert estimate.value[0] == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("modulation", MODULATIONS)
@pytest.mark.parametrize("snr", [0.01, 1.0, 10.0])
def test_equation_5_as_printed(modulation: str, snr: float) -> None:
    antennas = 1 if modulation == "64qam" else 2
    H = np.sqrt(snr) * channel(1, 1, 1, antennas)
    P = np.eye(antennas)[None]
    rng = np.random.default_rng(1)
    estimate = mutual_information(H, P, modulation, 1.0, rng=rng, tolerance=1e-3)
    expected = by_hermite(H[0], modulation, 30 if modulation == "16qam" else 50)
    assert abs(estimate.value[0] - expected) < 4 * estimate.error[0] + 2e-4
    assert estimate.error[0] <= 1e-3


@pytest.mark.parametrize("modulation", ["16qam", "64qam"])
def test_two_parts_of_one_symbol_carry_what_a_grid_says(modulation: str) -> None:
    H = np.sqrt(20.0) * channel(3, 12, 2, 1)
    one, rng = np.ones((12, 1, 1)), np.random.default_rng(1)
    found = mutual_information(H, one, modulation, 1.0, rng=rng, tolerance=1e-5)
    maps = real_channel(H, one, 1.0, real=False)[1]
    exact, _ = by_quadrature(maps, real_inputs(modulation, 1), 1e-6)
    assert not found.random.any()
    assert (found.error <= 1e-5).all()
    assert np.abs(found.value - exact).max() <= 1.1e-5


@pytest.mark.parametrize(("modulation", "antennas"), [("bpsk", 2), ("bpsk", 3), ("qpsk", 2)])
@pytest.mark.parametrize("snr", [0.1, 1.0, 10.0, 100.0])
def test_both_methods_agree_within_their_errors(modulation: str, antennas: int, snr: float) -> None:
    n = 40
    H, P = np.sqrt(snr) * channel(2, n, 1, antennas), np.eye(antennas)[None].repeat(n, axis=0)
    rng = np.random.default_rng(3)
    inputs = real_inputs(modulation, antennas)
    maps = real_channel(H, P, 1.0, real=modulation == "bpsk")[1]
    exact, _ = by_quadrature(maps, inputs, 1e-6)
    gap = inputs.bits - cutoff_rate(H, P, difference_classes(modulation, antennas), 1.0)
    value, error = np.empty(n), np.empty(n)
    for rare in (False, True):
        slots = (gap < 0.5) == rare
        if slots.any():
            value[slots], error[slots] = by_lattice(maps[slots], inputs, 3e-3, rng, rare=rare)
    assert np.all(error <= 3e-3)
    # Errors are Student-distributed with 15 degrees of freedom: 5 is next to never passed. Without
    # wide noises, slots of high SNR would meet no errors and claim 1e-14.
    off = np.abs(value - exact)
    assert np.all(off <= 5 * error + 1e-5)
    assert np.mean(off <= 2 * error + 1e-4) > 0.85


@pytest.mark.parametrize(("modulation", "snr"), [("bpsk", 2.0), ("qpsk", 2.0), ("16qam", 20.0)])
def test_standard_errors_are_honest(modulation: str, snr: float) -> None:
    """The same slot many times over: the spread of its values is what each of them claims."""
    n, antennas = 60, 3 if modulation == "bpsk" else 2
    H = np.sqrt(snr) * channel(4, 1, 2, antennas).repeat(n, axis=0)
    P = np.eye(antennas)[None].repeat(n, axis=0)
    runs = mutual_information(H, P, modulation, 1.0, rng=np.random.default_rng(5), tolerance=8e-3)
    assert runs.random.all()
    claimed = np.sqrt(np.mean(runs.error**2))
    assert 0.7 * claimed < np.std(runs.value) < 1.4 * claimed
    fine = mutual_information(
        H[:1], P[:1], modulation, 1.0, rng=np.random.default_rng(6), tolerance=5e-4
    )
    assert abs(np.mean(runs.value) - fine.value[0]) < 4 * (claimed / np.sqrt(n) + fine.error[0])


@pytest.mark.parametrize("snr", [0.05, 0.5, 5.0, 50.0])
def test_grid_errors_are_honest(snr: float) -> None:
    n = 60
    H, P = np.sqrt(snr) * channel(7, n, 2, 2), np.eye(2)[None].repeat(n, axis=0)
    rng = np.random.default_rng(0)
    coarse = mutual_information(H, P, "bpsk", 1.0, rng=rng, tolerance=1e-3)
    fine = mutual_information(H, P, "bpsk", 1.0, rng=rng, tolerance=1e-9)
    assert np.all(coarse.error <= 1e-3)
    assert np.all(np.abs(coarse.value - fine.value) <= coarse.error + 1e-7)


@settings(deadline=None, derandomize=True, max_examples=25)
@given(
    st.integers(0, 10_000),
    st.sampled_from([("bpsk", 1), ("bpsk", 2), ("bpsk", 3), ("qpsk", 2), ("8psk", 2)]),
    st.integers(1, 3),
    st.floats(-9.0, 5.0),
)
def test_between_cutoff_rate_and_ceiling(
    seed: int, case: tuple[str, int], receive: int, exponent: float
) -> None:
    modulation, antennas = case
    H, P = channel(seed, 2, receive, antennas), channel(seed + 1, 2, antennas, antennas)
    noise = 10.0**-exponent
    classes = difference_classes(modulation, antennas)
    estimate = mutual_information(
        H, P, modulation, noise, rng=np.random.default_rng(0), tolerance=5e-3
    )
    slack = 4 * estimate.error + 1e-12
    assert np.all(estimate.value >= cutoff_rate(H, P, classes, noise) * (1 - 1e-9) - slack)
    assert np.all(estimate.value <= classes.bits + 1e-9)
    # and below what Gaussian inputs of the same power would carry
    gram = np.swapaxes(H @ P, 1, 2).conj() @ (H @ P) / noise
    gaussian = np.linalg.slogdet(np.eye(antennas) + gram)[1] / np.log(2.0)
    assert np.all(estimate.value <= gaussian * (1 + 1e-6) + slack)


@pytest.mark.parametrize("modulation", MODULATIONS)
def test_extremes_are_immediate_and_right(modulation: str) -> None:
    H = np.array([[[1.0, 0.3j], [0.2, 1.0]]])
    P = np.eye(2)[None]
    rng = np.random.default_rng(0)
    before = rng.bit_generator.state
    bits = difference_classes(modulation, 2).bits
    high = mutual_information(H, P, modulation, 1e-9, rng=rng)
    assert high.value[0] == bits
    assert not high.random[0]
    for noise in (1e5, 1e9, 1e12):
        low = mutual_information(H, P, modulation, noise, rng=rng)
        # I = E||H x||² / σ² / ln 2 to first order, BPSK as well
        expected = np.linalg.norm(H) ** 2 / noise / np.log(2.0)
        assert low.value[0] == pytest.approx(expected, rel=1e-4)
        assert low.error[0] <= 1e-6 * expected
    none = mutual_information(0 * H, P, modulation, 1.0, rng=rng)
    assert none.value[0] == 0.0
    assert rng.bit_generator.state == before


def test_series_meets_quadrature_where_they_change_over() -> None:
    one = np.ones((2, 1, 1))
    for modulation in ("bpsk", "qpsk"):
        P = np.sqrt(np.array([0.999, 1.001]) * 0.5e-3)[:, None, None]
        rates = mutual_information(
            one, P, modulation, 1.0, rng=np.random.default_rng(0), tolerance=1e-12
        )
        assert rates.value[0] / rates.value[1] == pytest.approx(0.999 / 1.001, rel=3e-6)


def test_points_that_coincide_at_high_snr() -> None:
    """One receiving antenna, equal gains: of the four sums two coincide, 1.5 bits are left."""
    H, P = np.array([[[1.0, 1.0]]]), np.eye(2)[None]
    estimate = mutual_information(H, P, "bpsk", 1e-5, rng=np.random.default_rng(0))
    assert estimate.value[0] == pytest.approx(1.5, abs=1e-9)
    estimate = mutual_information(H, P, "16qam", 1e-5, rng=np.random.default_rng(0))
    p = np.array([1, 2, 3, 4, 3, 2, 1]) / 16
    assert estimate.value[0] == pytest.approx(-2 * p @ np.log2(p), abs=4e-3)


@pytest.mark.parametrize("modulation", ["bpsk", "qpsk", "16qam"])
def test_mean_over_slots(modulation: str) -> None:
    n = 50
    H, P = np.sqrt(3.0) * channel(8, n, 2, 2), np.eye(2)[None].repeat(n, axis=0)
    tolerance = 3e-3
    slots, again = (
        pooled_mutual_information(
            H, P, modulation, 1.0, rng=np.random.default_rng(1), tolerance=tolerance
        )
        for _ in range(2)
    )
    assert slots.value.tobytes() == again.value.tobytes()
    mean, error = float(slots.value.mean()), slots.mean_error
    assert error <= tolerance
    fine = mutual_information(
        H, P, modulation, 1.0, rng=np.random.default_rng(2), tolerance=tolerance
    )
    spread = np.sqrt(np.sum(fine.error**2)) / n
    assert abs(mean - fine.value.mean()) < 4 * (error + spread)


def test_mixed_slots_in_one_call() -> None:
    H = channel(9, 4, 2, 2) * np.array([0.0, 1e-6, 1.0, 1e5])[:, None, None]
    estimate = mutual_information(
        H, np.eye(2)[None].repeat(4, axis=0), "qpsk", 1.0, rng=np.random.default_rng(1)
    )
    assert estimate.random.any()
    assert estimate.value[0] == 0.0
    assert 0.0 < estimate.value[1] < 1e-9
    assert 0.5 < estimate.value[2] < 4.0
    assert estimate.value[3] == 4.0


def test_what_is_refused() -> None:
    one, rng = np.ones((1, 1, 1)), np.random.default_rng(0)
    with pytest.raises(InputError, match="noise"):
        mutual_information(one, one, "bpsk", 0.0, rng=rng)
    with pytest.raises(InputError, match="tolerance"):
        mutual_information(one, one, "bpsk", 1.0, rng=rng, tolerance=0.0)
    three = np.eye(3)[None]
    with pytest.raises(InputError, match="64qam on 3 antennas has 262144"):
        mutual_information(three, three, "64qam", 1.0, rng=rng)


def test_normal_grid_has_the_moments_of_the_normal_distribution() -> None:
    for dimensions in (1, 2):
        z, weight = normal_grid(dimensions, 0.5)
        np.testing.assert_allclose((z * weight[:, None]).sum(axis=0), 0.0, atol=1e-12)
        np.testing.assert_allclose((z**2 * weight[:, None]).sum(axis=0), 1.0, rtol=1e-6)
        np.testing.assert_allclose((z**4 * weight[:, None]).sum(axis=0), 3.0, rtol=1e-5)


@pytest.mark.parametrize("dimensions", [1, 3, 9])
def test_refined_lattice_is_the_finer_lattice(dimensions: int) -> None:
    both = np.vstack([lattice(64, dimensions), lattice(64, dimensions, refine=True)])
    finer = lattice(128, dimensions)
    np.testing.assert_array_equal(np.unique(both, axis=0), np.unique(finer, axis=0))
    for column in finer.T:  # every projection on one axis is evenly spaced
        np.testing.assert_array_equal(np.sort(column), np.arange(128) / 128)


@pytest.mark.parametrize("modulation", ["bpsk", "qpsk", "8psk", "16qam"])
def test_gaussian_controls_have_mean_zero(modulation: str) -> None:
    inputs = real_inputs(modulation, 1)
    _, maps = real_channel(channel(5, 3, 1, 1), np.ones((3, 1, 1)), 0.2, modulation == "bpsk")
    z, weight = normal_grid(maps.shape[-1], 0.5)
    sent = np.repeat(inputs.sent, len(z))[None].repeat(3, axis=0)
    noises = np.tile(z, (len(inputs.sent), 1))[None].repeat(3, axis=0)
    moment = inputs.points[inputs.sent].T @ inputs.points[inputs.sent] / len(inputs.sent)
    terms = gaussian_controls(inputs, maps, moment, sent, noises)
    mean = weight @ terms.reshape(3, len(inputs.sent), len(z), 2).mean(axis=1)
    assert np.abs(mean).max() < 1e-7


def test_pooled_errors_are_those_beside_quadrature() -> None:
    n, inputs = 400, real_inputs("qpsk", 2)
    P = np.eye(2)[None].repeat(n, axis=0)
    for snr in (0.1, 1.0):
        H = np.sqrt(snr) * channel(6, n, 1, 2)
        maps = real_channel(H, P, 1.0, real=False)[1]
        exact, _ = by_quadrature(maps, inputs, 1e-6)
        value, error = by_lattice(maps, inputs, 0.05, np.random.default_rng(7), pooled=True)
        stated = np.sqrt(np.mean(error**2))
        assert np.sqrt(np.mean((value - exact) ** 2)) < 1.25 * stated
        assert abs(np.mean(value - exact)) < 4 * stated / np.sqrt(n)


@pytest.mark.parametrize("modulation", ["16qam", "64qam"])
def test_likelihoods_by_parts(modulation: str) -> None:
    rng, inputs = np.random.default_rng(4), real_inputs(modulation, 2)
    H = rng.standard_normal((6, 2, 2)) + 1j * rng.standard_normal((6, 2, 2))
    H[1, :, 0] = 0.0  # a symbol that is not received
    H[2] = H[2, :, :1] * [1.0, 1e-3]  # both on one mode, one weakly
    H[3] *= 1e-6
    H[4] *= 30.0
    _, maps = real_channel(H, np.broadcast_to(np.eye(2), H.shape), 1.0, real=False)
    sent = rng.integers(len(inputs.points), size=(6, 40))
    z = 2.0 * rng.standard_normal((6, 40, maps.shape[-1]))
    assert inputs.levels is not None
    found = log_ratio_by_parts(inputs.points, inputs.levels, maps, sent, z)
    np.testing.assert_allclose(found, log_ratio(inputs.points, maps, sent, z), rtol=1e-9, atol=1e-9)
    y = inputs.points[sent[0]] @ maps[0] + z[0]
    apart = np.sum((y[:, None] - inputs.points @ maps[0]) ** 2, axis=-1)
    expected = np.log(np.exp(-0.5 * apart).sum(axis=1)) + 0.5 * np.sum(z[0] ** 2, axis=-1)
    np.testing.assert_allclose(found[0], expected, rtol=1e-9, atol=1e-9)
