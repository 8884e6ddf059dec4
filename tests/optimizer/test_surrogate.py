"""Propositions 1 and 2 as (27) and (35) use them; the gradients (25), (26), (33), (34)."""

from dataclasses import replace
from typing import NamedTuple

import cvxpy as cp
import numpy as np
import pytest
from conftest import MakePlan
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.algorithm1.precoder_step import precoder_exponents, precoder_tangent
from faao_mav.optimizer.algorithm1.successive import CAP, shrink
from faao_mav.optimizer.algorithm1.trajectory_step import (
    SumOfExponentials,
    convex_bound,
    merge_equal,
)
from faao_mav.optimizer.kinematics import LENGTH
from faao_mav.optimizer.problem import build_problem
from faao_mav.radio.constellation import difference_classes


def squared_distance(w: Real, station: Real) -> Real:
    return np.asarray(np.sum((w - station) ** 2, axis=-1))


def trajectory_exponents(A: Real, w: Real, station: Real, altitude: float) -> Real:
    """D = rho_0 A / (||w - p||^2 + H^2), (n, k)."""
    return np.asarray(A / (squared_distance(w, station) + altitude**2)[:, None])


def trajectory_exponents_bound(A: Real, w: Real, w_i: Real, station: Real, altitude: float) -> Real:
    """D^lb of Proposition 1 about the trajectory w_i, (n, k)."""
    y, y_i = squared_distance(w, station), squared_distance(w_i, station)
    d2 = y_i + altitude**2
    return np.asarray(A / d2[:, None] * (1 - (y - y_i) / d2)[:, None])


def trajectory_sum_gradient(
    A: Real, multiplicity: Real, w: Real, station: Real, altitude: float
) -> Real:
    """The gradient of F = sum of multiplicity exp(-D) in w, (25), (n, 2).

    (25) prints the derivative along ||w - p|| and with a minus in front: but F grows with the
    distance. Here the vector w - p takes the place of its norm, and the sign is the true one.
    """
    d2 = squared_distance(w, station) + altitude**2
    D = trajectory_exponents(A, w, station, altitude)
    slope = (multiplicity * A * np.exp(-D)).sum(axis=1) * 2 / d2**2
    return np.asarray(slope[:, None] * (w - station))


def trajectory_bound_gradient(
    A: Real, multiplicity: Real, w: Real, w_i: Real, station: Real, altitude: float
) -> Real:
    """The gradient of F^lb = sum of multiplicity exp(-D^lb) in w, (26), (n, 2)."""
    d2 = squared_distance(w_i, station) + altitude**2
    D = trajectory_exponents_bound(A, w, w_i, station, altitude)
    slope = (multiplicity * A * np.exp(-D)).sum(axis=1) * 2 / d2**2
    return np.asarray(slope[:, None] * (w - station))


def precoder_exponents_bound(
    M: Complex, P: Complex, P_i: Complex, u: Complex, noise: float, power: float = 2.0
) -> Real:
    """C^ap / (4 sigma^2) of Proposition 2 about P_i, (n, k), from the tangent that (35) uses."""
    slope, c = precoder_tangent(M, P_i, u, power, noise)
    flat = P.reshape(len(P), -1) / np.sqrt(power)
    p = np.concatenate([flat.real, flat.imag], axis=1)
    return np.asarray(np.einsum("nkp,np->nk", slope, p) - c)


def precoder_sum_gradient(
    M: Complex, multiplicity: Real, P: Complex, u: Complex, noise: float
) -> Complex:
    """The derivative (33) of E = sum of multiplicity exp(-C / 4 sigma^2), (n, N, N).

    The change of E for a small change dP is the real part of sum(conj(derivative) dP).
    """
    weight = multiplicity * np.exp(-precoder_exponents(M, P, u, noise))
    return precoder_slope(M, P, weight, u, noise)


def precoder_bound_gradient(
    M: Complex, multiplicity: Real, P: Complex, P_i: Complex, u: Complex, noise: float
) -> Complex:
    """The derivative (34) of E^ap = sum of multiplicity exp(-C^ap / 4 sigma^2), (n, N, N)."""
    weight = multiplicity * np.exp(-precoder_exponents_bound(M, P, P_i, u, noise))
    return precoder_slope(M, P_i, weight, u, noise)


def precoder_slope(M: Complex, P: Complex, weight: Real, u: Complex, noise: float) -> Complex:
    scatter = np.einsum("nk,ka,kb->nab", weight, u, u.conj(), optimize=True)
    return np.asarray(-2 * (M @ P @ scatter) / (4 * noise))


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
        return np.asarray(rng.standard_normal((3, 2, 2)) + 1j * rng.standard_normal((3, 2, 2)))

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
        return np.asarray(np.exp(-D) @ f.multiplicity)

    def F_lb(w: Real) -> Real:
        D = trajectory_exponents_bound(f.A, w, f.w_i, f.station, f.altitude)
        return np.asarray(np.exp(-D) @ f.multiplicity)

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
        return np.asarray(np.exp(-precoder_exponents(s.M, P, s.u, s.noise)) @ s.multiplicity)

    def E_ap(P: Complex) -> Real:
        C = precoder_exponents_bound(s.M, P, s.P_i, s.u, s.noise)
        return np.asarray(np.exp(-C) @ s.multiplicity)

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


@settings(deadline=None, max_examples=30)
@given(SEEDS)
def test_27_is_solved_with_the_bound_of_proposition_1(small_plan: MakePlan, seed: int) -> None:
    f = flown(seed, 30.0)
    link = build_problem(small_plan()).bs_uav
    link = replace(link, station=f.station, altitude=f.altitude)
    k = len(link.classes.multiplicity)
    A = f.A[:, :1] * np.linspace(0.1, 1.0, k)
    c = trajectory_exponents(A, f.w_i, f.station, f.altitude)
    A *= np.minimum(1.0, 0.9 * CAP / c.max(axis=1))[:, None]
    sums = SumOfExponentials(link, A, 0.0)
    total, (quadratic,) = convex_bound(sums, f.w_i, cp.Constant(f.w / LENGTH), 2.0)
    (q,) = total.variables()
    q.value = quadratic.args[0].value
    D_lb = trajectory_exponents_bound(A, f.w, f.w_i, f.station, f.altitude)
    expected = (link.classes.multiplicity * np.exp(-D_lb)).sum()
    assert 2.0 * total.value == pytest.approx(expected, rel=1e-6)
    assert 2.0 * total.value >= sums.value(f.w) * (1 - 1e-9)


ROWS = st.lists(st.sampled_from([0.0, 1.0, 1.5, 40.0]), min_size=4, max_size=4)


@given(st.lists(ROWS, min_size=1))
def test_merged_terms_have_the_same_sum(rows: list[list[float]]) -> None:
    c, multiplicity = np.array(rows), np.array([1.0, 2.0, 4.0, 8.0])
    slot, merged, weight = merge_equal(c, multiplicity)
    total = np.bincount(slot, weights=weight * np.exp(-merged), minlength=len(c))
    assert total == pytest.approx(np.exp(-c) @ multiplicity)
    assert len(merged) == sum(len(set(row)) for row in rows)


@given(st.floats(0, 1e6), st.floats(-3, 5))
def test_a_shrunk_term_stays_an_upper_bound(c: float, relative: float) -> None:
    """For an exponent worth c at the point of expansion and `relative` c elsewhere."""
    factor = float(shrink(np.array(c)))
    true = min(1.0, np.exp(-max(0.0, relative * c)))
    assert np.exp(-relative * c * factor) >= true * (1 - 1e-12)
    assert np.exp(-c * factor) - np.exp(-c) <= np.exp(-CAP)
