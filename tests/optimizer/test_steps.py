"""(27) and (35) as convex problems."""

from dataclasses import replace

import numpy as np
import pytest
from closed_forms import bpsk_two_antennas_rate
from conftest import MakePlan

from faao_mav.optimizer.algorithm1 import (
    SumOfExponentials,
    link_sum,
    optimize_precoders,
    optimize_trajectory,
    xi,
)
from faao_mav.optimizer.problem import Problem, build_problem
from faao_mav.optimizer.search.straight import straight_flight


def sums_of(problem: Problem) -> tuple[SumOfExponentials, ...]:
    """Both sums on the straight flight with equal-power precoders."""
    w = straight_flight(problem.kinematics).w
    return tuple(
        link_sum(
            link,
            link.small_scale(w),
            np.tile(np.sqrt(link.power / 2) * np.eye(2, dtype=complex), (len(w), 1, 1)),
        )
        for link in problem.links
    )


@pytest.mark.parametrize("modulation", ["bpsk", "qpsk"])
@pytest.mark.parametrize("power", [-10, 10, 20])
def test_xi_never_increases_and_the_flight_stays_feasible(
    paper_plan: MakePlan, modulation: str, power: float
) -> None:
    problem = build_problem(
        paper_plan(
            {
                "radio.modulation": modulation,
                "radio.base_station.power_dbm": power,
                "radio.relay.power_dbm": power,
            }
        )
    )
    sums, start = sums_of(problem), straight_flight(problem.kinematics)
    flight = optimize_trajectory(problem, sums, start)
    assert xi(sums, flight.w) < xi(sums, start.w)
    assert xi(sums, optimize_trajectory(problem, sums, flight).w) <= xi(sums, flight.w)
    assert max(problem.kinematics.residuals(flight).values()) < 1e-6


def test_rounding_errors_do_not_change_a_digit(paper_plan: MakePlan) -> None:
    """Another processor's last bits in the exponents and slopes leave flight and precoders."""
    problem = build_problem(paper_plan())
    start, noise = straight_flight(problem.kinematics), np.random.default_rng(0)
    sums = sums_of(problem)
    off = [1 + 1e-15 * noise.standard_normal(s.A.shape) for s in sums]
    others = tuple(replace(s, A=s.A * each) for s, each in zip(sums, off, strict=True))
    flights = [optimize_trajectory(problem, each, start) for each in (sums, others)]
    assert flights[0].w.tobytes() == flights[1].w.tobytes()

    link, w = problem.bs_uav, start.w
    H = link.channel(w)
    P = np.tile(np.sqrt(link.power / 2) * np.eye(2, dtype=complex), (len(w), 1, 1))
    channels = (H, H * (1 + 1e-15 * noise.standard_normal(H.shape)))
    ends = [optimize_precoders(link, each, P) for each in channels]
    assert ends[0].tobytes() == ends[1].tobytes()


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))]
)
def test_35_reaches_the_closed_form_for_bpsk_and_two_antennas(
    paper_plan: MakePlan, seed: int
) -> None:
    problem = build_problem(paper_plan({"radio.seed": seed, "flight.duration": 20}))
    w = straight_flight(problem.kinematics).w
    for link in problem.links:
        H = link.channel(w)
        start = np.tile(np.sqrt(link.power / 2) * np.eye(2, dtype=complex), (len(w), 1, 1))
        P = optimize_precoders(link, H, start)
        assert (np.sum(np.abs(P) ** 2, axis=(1, 2)) <= link.power * (1 + 1e-9)).all()
        best = bpsk_two_antennas_rate(H, link.power, link.noise)
        rates = link.mean_rates(H, P)
        assert (rates <= best + 1e-9).all()
        assert rates.mean() == pytest.approx(best.mean(), abs=1e-3)
        assert link.mean_rates(H, start).mean() < best.mean() - 0.05
