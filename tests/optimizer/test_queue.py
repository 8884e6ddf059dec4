"""What is maximised: what a relay delivers, and the mutual information; beside known optima."""

from pathlib import Path
from typing import Any

import cvxpy as cp
import numpy as np
import pytest
from conftest import MISSIONS, MakePlan
from test_interior import ACTIVE, HEIGHT, STATIONS, copter, links, plane, worst

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.optimizer.algorithm1 import FlightVariables, minimize
from faao_mav.optimizer.interior.maximize import maximize, objective
from faao_mav.optimizer.kinematics import LENGTH, Kinematics
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.pricing import fresh_rates, price, saturation
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.search.bound import upper_bound
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.optimizer.solution import Rates, load_solution, save_solution
from faao_mav.plan import Plan, read_plan
from faao_mav.radio.relay import RelayQueue

SLOW = plane(20, min_speed=12.0, max_speed=25.0, start=np.array([0.0, 100.0]))
SAMPLE = read_plan(MISSIONS / "copter_relay.yaml")


def hill(q: Real, c: float) -> tuple[Real, Real, Real]:
    """3 - c q: concave, and above 0 where the flights are."""
    return 3 - c * q, np.full_like(q, -c), np.zeros_like(q)


def test_the_global_optimum_of_concave_rates() -> None:
    """The interior-point method finds the optimum that Clarabel finds of the convex problem."""
    buffer = 8.0
    kin = copter(80, time_step=1.0, max_speed=10.0)
    stage = links(hill, 1e-5, 1.5e-5)
    relay = RelayQueue(buffer=buffer)
    best = maximize(kin, stage, straight_flight(kin), relay=relay, tolerance=1e-7)
    flight, n = FlightVariables(kin), kin.slots
    received, forwarded, queue = (cp.Variable(n) for _ in range(3))
    rates = [
        3 - c * (HEIGHT**2 + LENGTH**2 * cp.sum(cp.square(flight.w - p[None] / LENGTH), axis=1))
        for c, p in zip((1e-5, 1.5e-5), STATIONS, strict=False)
    ]
    program = minimize(
        -cp.sum(forwarded) / n,
        [
            *flight.constraints,
            received <= rates[0],
            forwarded <= rates[1],
            forwarded <= queue,
            queue[0] == 0,
            queue[1:] == (queue + received - forwarded)[:-1],
            queue <= buffer,
        ],
    )
    assert best.converged
    assert best.value == pytest.approx(-float(program.value), rel=1e-5)
    assert worst(kin, best.trajectory) < 1e-6


@pytest.mark.parametrize(
    ("kin", "relay", "known"),
    [
        (copter(70), RelayQueue(half=True, buffer=20.0), 0.36513),
        (SLOW, RelayQueue(half=True), 0.5679),
    ],
)
def test_a_local_optimum_of_what_is_delivered(
    kin: Kinematics, relay: RelayQueue, known: float
) -> None:
    """`known` are optima by a convex program that finds nothing to gain about them."""
    best = maximize(kin, ACTIVE, straight_flight(kin), relay=relay, max_iterations=200)
    assert worst(kin, best.trajectory) < 1e-6
    assert best.converged
    assert best.value == pytest.approx(objective(ACTIVE(best.trajectory.w.T).value, kin, relay))
    assert best.value > known - 1e-4


@pytest.mark.figures
@pytest.mark.parametrize(("duplex", "rate"), [("half", 1.4117), ("full", 2.243)])
def test_the_sample_delivers_what_ipopt_does(duplex: str, rate: float) -> None:
    """What CasADi + IPOPT delivers on the copter's sample (benchmarks)."""
    solution = optimize(SAMPLE.changed({"radio.duplex": duplex, "optimizer.max_iterations": 100}))
    assert rate * (1 - 1e-3) <= solution.delivered_rate <= solution.rates.R_avg
    assert solution.history[-1] == solution.delivered_rate
    assert solution.is_feasible()


def test_shares_are_saved_and_read(small_plan: MakePlan, tmp_path: Path) -> None:
    path = tmp_path / "result.npz"
    megabyte = {"radio.bandwidth_mhz": 2, "radio.relay.buffer_mbytes": 1}
    half = {"radio.causal": True, "radio.duplex": "half", "radio.fading": "none"}
    solution = optimize(small_plan(half | megabyte))
    assert solution.problem.relay.buffer == 4.0  # bits per hertz
    save_solution(solution, path)
    loaded = load_solution(path)
    assert solution.shares is not None
    assert loaded.shares is not None
    assert loaded.shares.tobytes() == solution.shares.tobytes()
    assert loaded.delivered_rate == solution.delivered_rate
    with np.load(path) as archive:
        assert archive["forwarded"].mean() == solution.delivered_rate == archive["R_del"]
        for name, value, told in (
            ("shares", archive["shares"] + 0.5, "shares: expected a number of 0 to 1"),
            ("P_U", 2 * archive["P_U"], "P_U: has 4 times the power"),
        ):
            np.savez(tmp_path / "other.npz", **{**archive, name: value})
            with pytest.raises(InputError, match=told):
                load_solution(tmp_path / "other.npz")


FOR_IT = {"optimizer.rate": "mutual_information", "radio.modulation": "qpsk", "power": 5}
BPSK = {"radio.modulation": "bpsk", "power": 0}


def plan_of(small_plan: MakePlan, changes: dict[str, Any]) -> Plan:
    """The small plan for the mutual information of QPSK, at a power where it matters."""
    wanted = FOR_IT | {"optimizer.starts": ["straight"]} | changes
    power = wanted.pop("power")
    powers = {"radio.base_station.power_dbm": power, "radio.relay.power_dbm": power}
    return small_plan(powers | wanted)


@pytest.mark.usefixtures("coarse_map")
def test_plans_for_the_mutual_information(small_plan: MakePlan, tmp_path: Path) -> None:
    """Two ways to average over the noise, and one answer; more than the plan for cutoff rates."""
    drawn = {"radio.fading_samples": 8, "radio.causal": True}
    planned = optimize(plan_of(small_plan, BPSK | drawn))
    information = price(planned)
    assert planned.rates.R_avg == pytest.approx(information.average, abs=0.02)
    assert planned.delivered_rate == pytest.approx(information.delivered, abs=0.02)
    assert information.delivered <= information.average + 1e-9
    assert planned.gain is not None
    assert planned.gain > 0.005
    assert planned.converged
    fresh = fresh_rates(planned)
    assert fresh is not None
    assert fresh.delivered == pytest.approx(planned.delivered_rate, abs=0.3)
    assert fresh.delivered_error < 0.1
    assert not saturation(planned).saturated
    bound = upper_bound(planned.problem, planned.rates.R_avg)
    assert planned.rates.R_avg <= bound.value < 1.1 * planned.rates.R_avg
    assert not bound.exact
    save_solution(planned, tmp_path / "result.npz")
    loaded = load_solution(tmp_path / "result.npz")
    assert loaded.gain == planned.gain
    assert Rates.of(*loaded.recomputed_slots()) == planned.rates
    gaussian = optimize(
        plan_of(small_plan, {"radio.fading": "none", "optimizer.inputs": "gaussian"})
    )
    assert gaussian.history[-1] == pytest.approx(gaussian.rates.R_avg, abs=1e-12)
    assert gaussian.gain is None
    half = {"radio.fading": "none", "radio.causal": True, "radio.duplex": "half"}
    plan = plan_of(small_plan, BPSK | half)
    solution = optimize(plan)
    assert solution.is_feasible()
    assert solution.history[-1] == pytest.approx(solution.delivered_rate, abs=1e-12)
    assert solution.gain is not None
    assert solution.gain > -1e-4
    before = optimize(plan.changed({"optimizer.rate": "cutoff"}))
    assert before.gain is None
    assert solution.rates.R_avg > before.rates.R_avg  # of the same flight it would be above too
    problem = build_problem(plan)
    rates = [
        link.mean_rates(link.channel(before.w, H_r), P)
        for link, H_r, P in zip(
            problem.links, (before.H_rB, before.H_rU), (before.P_B, before.P_U), strict=True
        )
    ]
    reached = before.relay(*rates).rate
    assert solution.delivered_rate - solution.gain == pytest.approx(reached, abs=1e-9)
