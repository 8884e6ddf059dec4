"""Propositions 1 and 2, and (25), (26), (33), (34)."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.algorithm1.surrogate import (
    precoder_bound_gradient,
    precoder_exponents,
    precoder_exponents_bound,
    precoder_sum_gradient,
    trajectory_bound_gradient,
    trajectory_exponents,
    trajectory_exponents_bound,
    trajectory_sum_gradient,
)
from faao_mav.radio.constellation import difference_classes


class Flown(NamedTuple):
    """A random trajectory, a point of expansion and the coefficients rho_0 A."""

    A: Real
    multiplicity: Real
    w: Real
    w_i: Real
    station: Real
    altitude: float


class Sent(NamedTuple):
    """Random precoders, a point of expansion and a channel."""

    M: Complex
    multiplicity: Real
    P: Complex
    P_i: Complex
    u: Complex
    noise: float


SEEDS = st.integers(0, 2**32 - 1)


def flown(seed: int, step: float) -> Flown:
    rng = np.random.default_rng(seed)
    altitude = rng.uniform(20, 200)
    A = 10 ** rng.uniform(-2, 2, (4, 5)) * altitude**2
    w_i = rng.uniform(-300, 300, (4, 2))
    w = w_i + step * rng.standard_normal((4, 2))
    multiplicity = rng.integers(1, 9, 5).astype(float)
    return Flown(A, multiplicity, w, w_i, rng.uniform(-300, 300, 2), altitude)


def sent(seed: int, step: float) -> Sent:
    rng = np.random.default_rng(seed)

    def matrix() -> Complex:
        return rng.standard_normal((3, 2, 2)) + 1j * rng.standard_normal((3, 2, 2))

    H, P_i = matrix(), matrix()
    classes = difference_classes("qpsk", 2)
    M = np.conj(np.swapaxes(H, 1, 2)) @ H
    noise = 10 ** rng.uniform(-1, 1)
    return Sent(M, classes.multiplicity, P_i + step * matrix(), P_i, classes.vectors, noise)


@given(SEEDS, st.sampled_from([1e-3, 1.0, 100.0, 1e4]))
def test_proposition_1_bounds_from_below_and_touches(seed: int, step: float) -> None:
    f = flown(seed, step)
    D = trajectory_exponents(f.A, f.w, f.station, f.altitude)
    D_lb = trajectory_exponents_bound(f.A, f.w, f.w_i, f.station, f.altitude)
    assert (D_lb <= D + 1e-9 * np.abs(D)).all()  # so exp(-D^lb) >= exp(-D) everywhere
    at = trajectory_exponents_bound(f.A, f.w_i, f.w_i, f.station, f.altitude)
    assert at == pytest.approx(trajectory_exponents(f.A, f.w_i, f.station, f.altitude), rel=1e-12)
    ours = trajectory_bound_gradient(f.A, f.multiplicity, f.w_i, f.w_i, f.station, f.altitude)
    true = trajectory_sum_gradient(f.A, f.multiplicity, f.w_i, f.station, f.altitude)
    assert ours == pytest.approx(true, rel=1e-9, abs=1e-300)


@given(SEEDS, st.floats(0, 1))
def test_proposition_1_bound_is_concave(seed: int, share: float) -> None:
    f = flown(seed, 50.0)
    w_2 = flown(seed + 1, 50.0).w

    def bound(w: Real) -> Real:
        return trajectory_exponents_bound(f.A, w, f.w_i, f.station, f.altitude)

    between = share * f.w + (1 - share) * w_2
    chord = share * bound(f.w) + (1 - share) * bound(w_2)
    assert (bound(between) >= chord - 1e-9 * (1 + np.abs(chord))).all()


@given(SEEDS, st.sampled_from([1e-3, 0.1, 1.0, 100.0]))
def test_proposition_2_bounds_from_below_and_touches(seed: int, step: float) -> None:
    s = sent(seed, step)
    C = precoder_exponents(s.M, s.P, s.u, s.noise)
    C_ap = precoder_exponents_bound(s.M, s.P, s.P_i, s.u, s.noise)
    size = 1 + np.abs(C) + np.abs(C_ap)
    assert (C_ap <= C + 1e-12 * size).all()
    at = precoder_exponents_bound(s.M, s.P_i, s.P_i, s.u, s.noise)
    assert at == pytest.approx(precoder_exponents(s.M, s.P_i, s.u, s.noise), rel=1e-12, abs=1e-12)
    ours = precoder_bound_gradient(s.M, s.multiplicity, s.P_i, s.P_i, s.u, s.noise)
    true = precoder_sum_gradient(s.M, s.multiplicity, s.P_i, s.u, s.noise)
    assert ours == pytest.approx(true, rel=1e-9, abs=1e-12)


@given(SEEDS)
def test_exponents_of_both_propositions_are_those_of_the_rate(seed: int) -> None:
    s = sent(seed, 1.0)
    direct = [
        [(np.conj(P @ u) @ M @ (P @ u)).real / (4 * s.noise) for u in s.u]
        for M, P in zip(s.M, s.P, strict=True)
    ]
    assert precoder_exponents(s.M, s.P, s.u, s.noise) == pytest.approx(np.array(direct))


@given(SEEDS)
def test_25_and_26_are_derivatives(seed: int) -> None:
    f = flown(seed, 20.0)

    def F(w: Real) -> Real:
        D = trajectory_exponents(f.A, w, f.station, f.altitude)
        return np.exp(-D) @ f.multiplicity

    def F_lb(w: Real) -> Real:
        D = trajectory_exponents_bound(f.A, w, f.w_i, f.station, f.altitude)
        return np.exp(-D) @ f.multiplicity

    h = 1e-3
    for axis in range(2):
        shift = h * np.eye(2)[axis]
        expected = (F(f.w + shift) - F(f.w - shift)) / (2 * h)
        found = trajectory_sum_gradient(f.A, f.multiplicity, f.w, f.station, f.altitude)
        assert found[:, axis] == pytest.approx(expected, rel=1e-5, abs=1e-9)
        expected = (F_lb(f.w + shift) - F_lb(f.w - shift)) / (2 * h)
        found = trajectory_bound_gradient(f.A, f.multiplicity, f.w, f.w_i, f.station, f.altitude)
        assert found[:, axis] == pytest.approx(expected, rel=1e-5, abs=1e-9)


@given(SEEDS)
def test_33_and_34_are_derivatives(seed: int) -> None:
    s = sent(seed, 0.3)

    def E(P: Complex) -> Real:
        return np.exp(-precoder_exponents(s.M, P, s.u, s.noise)) @ s.multiplicity

    def E_ap(P: Complex) -> Real:
        C = precoder_exponents_bound(s.M, P, s.P_i, s.u, s.noise)
        return np.exp(-C) @ s.multiplicity

    rng = np.random.default_rng(seed)
    direction = rng.standard_normal(s.P.shape) + 1j * rng.standard_normal(s.P.shape)
    h = 1e-5
    for function, derivative in (
        (E, precoder_sum_gradient(s.M, s.multiplicity, s.P, s.u, s.noise)),
        (E_ap, precoder_bound_gradient(s.M, s.multiplicity, s.P, s.P_i, s.u, s.noise)),
    ):
        expected = (function(s.P + h * direction) - function(s.P - h * direction)) / (2 * h)
        found = np.sum(np.conj(derivative) * direction, axis=(1, 2)).real
        assert found == pytest.approx(expected, rel=1e-4, abs=1e-6)
