"""Propositions 1 and 2 as (27) and (35) use them: bounds that touch at the last solution."""

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest
from conftest import MakePlan
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.algorithm1 import (
    CAP,
    SumOfExponentials,
    convex_bound,
    precoder_tangent,
    shrink,
)
from faao_mav.optimizer.kinematics import LENGTH
from faao_mav.optimizer.problem import build_problem
from faao_mav.radio.constellation import difference_classes
from faao_mav.radio.rate import exponents

SEEDS = st.integers(0, 2**32 - 1)


@settings(deadline=None, max_examples=60)
@given(SEEDS, st.sampled_from([0.0, 1e-3, 1.0, 30.0, 1e4]))
def test_27_has_the_bound_of_proposition_1(small_plan: MakePlan, seed: int, step: float) -> None:
    """exp(-D^lb), D^lb the tangent of D in ||w - p||²: never below exp(-D), and equal about w_i."""
    rng = np.random.default_rng(seed)
    altitude, station = rng.uniform(20, 200), rng.uniform(-300, 300, 2)
    link = build_problem(small_plan()).bs_uav
    link = replace(link, gains=replace(link.gains, station=station, height=altitude))
    w_i = rng.uniform(-300, 300, (4, 2))
    w = w_i + step * rng.standard_normal((4, 2))
    y, y_i = (np.sum((at - station) ** 2, axis=1) for at in (w, w_i))
    d2 = (y_i + altitude**2)[:, None]
    D_i = rng.uniform(0, 0.9 * CAP, (4, len(link.classes.multiplicity)))
    sums = SumOfExponentials(link, D_i * d2, 0.0)
    total, quadratic = convex_bound(sums, w_i, cp.Constant(w / LENGTH), 2.0)
    (q,) = total.variables()
    q.value = quadratic.args[0].value[:, None]
    D_lb = D_i * (1 - (y - y_i)[:, None] / d2)
    expected = float(np.sum(link.classes.multiplicity * np.exp(np.minimum(-D_lb, 600.0))))
    if D_lb.min() > -600.0:
        assert 2.0 * total.value == pytest.approx(expected, rel=1e-4)
    assert expected >= sums.excess(w) * (1 - 1e-9)
    if step == 0.0:
        assert expected == pytest.approx(sums.excess(w), rel=1e-12)


@given(SEEDS, st.sampled_from([0.0, 1e-3, 0.1, 1.0, 100.0]))
def test_35_has_the_bound_of_proposition_2(seed: int, step: float) -> None:
    rng = np.random.default_rng(seed)

    def matrix() -> Complex:
        return np.asarray(rng.standard_normal((3, 2, 2)) + 1j * rng.standard_normal((3, 2, 2)))

    H, P_i, power, noise = matrix(), matrix(), 2.0, 10 ** rng.uniform(-1, 1)
    P, u = P_i + step * matrix(), difference_classes("qpsk", 2).vectors
    slope, c = precoder_tangent(H, P_i, u, power, noise)
    flat = P.reshape(3, -1) / np.sqrt(power)
    p: Real = np.concatenate([flat.real, flat.imag], axis=1)
    C_ap, C = np.einsum("nkp,np->nk", slope, p) - c, exponents(H, P, u, noise)
    assert (C_ap <= C + 1e-12 * (1 + np.abs(C) + np.abs(C_ap))).all()
    if step == 0.0:
        assert C_ap == pytest.approx(C, rel=1e-9, abs=1e-12)


@given(st.floats(0, 1e6), st.floats(-3, 5))
def test_a_shrunk_term_stays_an_upper_bound(c: float, relative: float) -> None:
    """For an exponent worth c at the point of expansion and `relative` c elsewhere."""
    factor = float(shrink(np.array(c)))
    true = min(1.0, np.exp(-max(0.0, relative * c)))
    assert np.exp(-relative * c * factor) >= true * (1 - 1e-12)
    assert np.exp(-c * factor) - np.exp(-c) <= np.exp(-CAP)
