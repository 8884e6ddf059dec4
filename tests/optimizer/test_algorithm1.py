"""Algorithm 1, whole, and its convex problems (27) and (35)."""

from dataclasses import replace
from typing import Any

import cvxpy as cp
import numpy as np
import pytest
from closed_forms import bpsk_two_antennas_rate
from conftest import MakePlan
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.arrays import Complex, Real
from faao_mav.errors import PlanError, SolverError
from faao_mav.optimizer import algorithm1 as module
from faao_mav.optimizer.algorithm1 import (
    CAP,
    SumOfExponentials,
    convex_bound,
    link_sum,
    optimize_precoders,
    optimize_trajectory,
    precoder_tangent,
    shrink,
)
from faao_mav.optimizer.design import Link
from faao_mav.optimizer.kinematics import LENGTH
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.optimizer.solution import Progress
from faao_mav.radio.constellation import difference_classes
from faao_mav.radio.precoder import SCHEMES
from faao_mav.radio.rate import exponents

COARSE = {"flight.time_step": 1}
BRIEF = COARSE | {"optimizer.max_iterations": 1}


def test_a_solution_proves_itself_and_its_rates_are_7_to_10(paper_plan: MakePlan) -> None:
    told: list[Progress] = []
    solution = optimize(paper_plan(COARSE), observe=told.append)
    assert solution.converged
    assert "less than 0.0001" in solution.ending
    residuals = solution.residuals()
    assert {"(11) position", "(12) velocity", "(13d) ends", "(13e) speed"} <= set(residuals)
    assert max(residuals.values()) < 1e-6
    assert solution.rates.R_avg == pytest.approx(solution.history.max(), abs=1e-12)
    assert solution.rates.R_avg > solution.history[0] + 0.1
    assert {p.iteration for p in told} == set(range(1, solution.iterations + 1))
    assert {p.stage for p in told} == {"trajectory (27)", "precoders (35)"}
    assert [p.best_rate for p in told] == sorted(p.best_rate for p in told)
    assert told[0].best_rate == solution.history[0]
    radio, altitude = solution.plan.radio, solution.plan.flight.altitude
    x = np.array([[a, b] for a in (1, -1) for b in (1, -1)])
    rates = []
    for position, H_r, precoders, noise in (
        (radio.base_station.position, solution.H_rB, solution.P_B, radio.relay.noise),
        (radio.ground_user.position, solution.H_rU, solution.P_U, radio.ground_user.noise),
    ):
        bits = []
        for w, fading, P in zip(solution.w, H_r, precoders, strict=True):
            d2 = np.sum((w - position) ** 2) + altitude**2
            H = np.sqrt(radio.reference_gain / d2) * fading
            total = sum(
                np.exp(-(np.linalg.norm(H @ P @ (m - k)) ** 2) / (4 * noise)) for m in x for k in x
            )
            bits.append(2 * 2 - np.log2(total))
        rates.append(np.sum(bits) / solution.plan.flight.duration)
    assert solution.rates.R_U == pytest.approx(rates[0], abs=1e-9)
    assert solution.rates.R_G == pytest.approx(rates[1], abs=1e-9)
    assert solution.rates.R_avg == min(solution.rates.R_U, solution.rates.R_G)


def test_a_scheme_keeps_its_precoder(paper_plan: MakePlan) -> None:
    solution = optimize(paper_plan(BRIEF | {"optimizer.precoder": "mrt"}))
    assert max(solution.residuals().values()) < 1e-6
    radio = solution.plan.radio
    gain = radio.reference_gain / (np.sum(solution.w**2, axis=1) + 40.0**2)
    H = np.sqrt(gain)[:, None, None] * solution.H_rB
    expected = SCHEMES["mrt"](H, radio.base_station.power, radio.relay.noise)
    assert solution.P_B == pytest.approx(expected, rel=1e-9)
    assert solution.rates.R_avg > solution.history[0]


def test_unusual_plans_are_solved(paper_plan: MakePlan) -> None:
    antennas = {"radio.base_station.antennas": 3, "radio.ground_user.antennas": 1}
    ends = {"flight.start_velocity": [0, 6], "flight.end_velocity": [5, -3]}
    unequal = {"radio.base_station.power_dbm": 60, "radio.relay.power_dbm": -60}
    for changes in (antennas | ends | {"radio.line_of_sight": "all_ones"}, unequal):
        solution = optimize(paper_plan(BRIEF | changes))
        assert max(solution.residuals().values()) < 1e-6
        assert np.isfinite(solution.history).all()
        assert solution.rates.R_avg >= solution.history[0]


def test_a_solver_failure_keeps_the_best_so_far(
    paper_plan: MakePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def failing(*arguments: Any, **options: Any) -> Any:
        calls.append(1)
        if len(calls) > 2:
            raise SolverError("no progress")
        return optimize_precoders(*arguments, **options)

    monkeypatch.setattr(module, "optimize_precoders", failing)
    solution = optimize(paper_plan(COARSE))
    assert not solution.converged
    assert solution.ending == "stopped in iteration 2, the best so far is kept: no progress"
    assert solution.iterations == 1
    assert solution.rates.R_avg == pytest.approx(solution.history[1], abs=1e-12)


def test_what_it_is_not_made_for_is_refused(paper_plan: MakePlan) -> None:
    for changes, told in (
        ({"radio.modulation": "64qam"}, r"optimizer\.method: algorithm1 would need .* cones"),
        ({"radio.fading": "ergodic"}, r"radio\.fading: ergodic is not for algorithm1"),
        ({"optimizer.inputs": "gaussian"}, r"optimizer\.inputs: gaussian is not for algorithm1"),
        ({"optimizer.rate": "mutual_information"}, r"optimizer\.rate: mutual_.* is not for algor"),
        ({"radio.gain.exponent": 3}, r"radio\.gain is not for algorithm1"),
    ):
        with pytest.raises(PlanError, match=told):
            optimize(paper_plan(changes))


SEEDS = st.integers(0, 2**32 - 1)


@settings(max_examples=10)
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


def equal_power(link: Link, slots: int) -> Complex:
    return np.tile(np.sqrt(link.power / 2) * np.eye(2, dtype=complex), (slots, 1, 1))


def test_35_reaches_the_closed_form(paper_plan: MakePlan) -> None:
    problem = build_problem(paper_plan(COARSE))
    w = straight_flight(problem.kinematics).w
    for link in problem.links:
        H = link.channel(w)
        start = equal_power(link, len(w))
        P = optimize_precoders(link, H, start)
        assert (np.sum(np.abs(P) ** 2, axis=(1, 2)) <= link.power * (1 + 1e-9)).all()
        best = bpsk_two_antennas_rate(H, link.power, link.noise)
        rates = link.mean_rates(H, P)
        assert (rates <= best + 1e-9).all()
        assert rates.mean() == pytest.approx(best.mean(), abs=1e-3)
        assert link.mean_rates(H, start).mean() < best.mean() - 0.05


def test_another_processors_last_bits_leave_the_flight_as_it_is(paper_plan: MakePlan) -> None:
    problem = build_problem(paper_plan(COARSE))
    start, noise = straight_flight(problem.kinematics), np.random.default_rng(0)
    w = start.w
    sums = tuple(
        link_sum(link, link.small_scale(w), equal_power(link, len(w))) for link in problem.links
    )
    off = [1 + 1e-15 * noise.standard_normal(s.A.shape) for s in sums]
    others = tuple(replace(s, A=s.A * each) for s, each in zip(sums, off, strict=True))
    flights = [optimize_trajectory(problem, each, start) for each in (sums, others)]
    assert flights[0].w.tobytes() == flights[1].w.tobytes()

    link = problem.bs_uav
    H = link.channel(w)
    P = equal_power(link, len(w))
    channels = (H, H * (1 + 1e-15 * noise.standard_normal(H.shape)))
    ends = [optimize_precoders(link, each, P) for each in channels]
    assert ends[0].tobytes() == ends[1].tobytes()
