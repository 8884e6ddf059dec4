"""What a relay delivers, maximised: against convex programs, KKT conditions and known optima."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cvxpy as cp
import numpy as np
import pytest
from certificate import kkt_residual, still_gained
from conftest import MISSIONS, MakePlan, edited
from test_interior import ACTIVE, HEIGHT, STATIONS, bpsk, copter, links, plane, worst

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.optimizer.interior.maximize import maximize, objective
from faao_mav.optimizer.interior.rewards import Stage
from faao_mav.optimizer.kinematics import LENGTH, Kinematics
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.scaled import flight_variables
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.optimizer.solution import load_solution, save_solution
from faao_mav.plan import parse_plan
from faao_mav.radio.relay import RelayQueue

FULL, HALF = RelayQueue(), RelayQueue(half=True)
SAMPLE = (MISSIONS / "copter_relay.yaml").read_text()


def hill(q: Real, c: float) -> tuple[Real, Real, Real]:
    """3 - c q: concave, and above 0 where the flights are."""
    return 3 - c * q, np.full_like(q, -c), np.zeros_like(q)


@pytest.mark.parametrize("buffer", [math.inf, 8.0])
def test_the_global_optimum_of_concave_rates(buffer: float) -> None:
    """The interior-point method finds the optimum that Clarabel finds of the convex problem."""
    kin = copter(80, time_step=1.0, max_speed=10.0)
    stage = links(hill, 1e-5, 1.5e-5)
    relay = RelayQueue(buffer=buffer)
    best = maximize(kin, stage, straight_flight(kin), relay=relay, tolerance=1e-7)
    flight, n = flight_variables(kin), kin.slots
    received, forwarded, queue = (cp.Variable(n) for _ in range(3))
    rates = [
        3 - c * (HEIGHT**2 + LENGTH**2 * cp.sum(cp.square(flight.w - p[None] / LENGTH), axis=1))
        for c, p in zip((1e-5, 1.5e-5), STATIONS, strict=False)
    ]
    program = cp.Problem(
        cp.Maximize(cp.sum(forwarded) / n),
        [
            *flight.constraints,
            received <= rates[0],
            forwarded <= rates[1],
            forwarded <= queue,
            queue[0] == 0,
            queue[1:] == (queue + received - forwarded)[:-1],
            *([queue <= buffer] if math.isfinite(buffer) else []),
        ],
    )
    program.solve(solver=cp.CLARABEL)
    assert best.converged
    assert best.value == pytest.approx(program.value, rel=1e-5)
    assert worst(kin, best.trajectory) < 1e-6


@pytest.mark.parametrize(
    "relay", [FULL, HALF, RelayQueue(buffer=20.0), RelayQueue(half=True, buffer=20.0)]
)
@pytest.mark.parametrize(
    ("kin", "stage"),
    [
        (copter(100, time_step=0.5), ACTIVE),
        pytest.param(copter(70, time_step=0.5), links(bpsk, 4e3, 4e3), marks=pytest.mark.slow),
        pytest.param(plane(15), ACTIVE, marks=pytest.mark.slow),
        (plane(20, min_speed=12.0, max_speed=25.0, start=np.array([0.0, 100.0])), ACTIVE),
    ],
)
def test_a_local_optimum_of_what_is_delivered(
    relay: RelayQueue, kin: Kinematics, stage: Stage
) -> None:
    start = straight_flight(kin)
    best = maximize(kin, stage, start, relay=relay, max_iterations=200)
    assert worst(kin, best.trajectory) < 1e-6
    reached = objective(stage(best.trajectory.w.T).value, kin, relay)
    assert best.value == pytest.approx(reached)
    gain = kkt_residual(kin, stage, best.trajectory, relay=relay)
    assert gain < 0.02 * kkt_residual(kin, stage, start, relay=relay)


@dataclass(frozen=True)
class Known:
    """What CasADi + IPOPT delivers on the copter's sample (benchmarks)."""

    duration: float
    duplex: str
    rate: float


@pytest.mark.figures
@pytest.mark.parametrize(
    "known",
    [
        pytest.param(Known(120, "full", 2.243), marks=pytest.mark.slow),  # README's plan
        Known(120, "half", 1.4117),
        Known(70, "full", 2.0358),
        Known(70, "half", 1.0851),
    ],
)
def test_the_sample_delivers_what_is_known_to_be_possible(known: Known) -> None:
    changes = {
        "flight.duration": known.duration,
        "radio.causal": True,
        "radio.duplex": known.duplex,
        "optimizer.max_iterations": 100,
    }
    solution = optimize(parse_plan(edited(SAMPLE, changes)))
    assert solution.delivered_rate >= known.rate * (1 - 1e-3)
    assert solution.delivered_rate <= solution.rates.R_avg
    assert solution.history[-1] == solution.delivered_rate
    assert solution.is_feasible()
    assert still_gained(solution) < 1e-4


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("copter_relay", {"radio.bandwidth_mhz": 20, "radio.relay.buffer_mbytes": 20}),
        *(
            (
                "copter_relay",
                {
                    "flight.duration": duration,
                    "flight.time_step": step,
                    "radio.bandwidth_mhz": 20,
                    "radio.relay.buffer_mbytes": buffer,
                    "radio.duplex": "half",
                },
            )
            for duration, step, buffer in ((120, 1, 5), (70, 0.5, 2))
        ),
        ("plane_relay", {"flight.duration": 100, "flight.time_step": 1}),
    ],
)
def test_small_buffers_and_planes_converge(name: str, changes: dict[str, Any]) -> None:
    solution = optimize(parse_plan(edited((MISSIONS / f"{name}.yaml").read_text(), changes)))
    assert solution.converged
    assert still_gained(solution) < 1e-4


@pytest.mark.parametrize("fading", ["none", "realization"])
def test_planning_for_what_arrives_delivers_more(small_plan: MakePlan, fading: str) -> None:
    for duplex in ("full", "half"):
        changes = {
            "radio.fading": fading,
            "radio.duplex": duplex,
            "radio.bandwidth_mhz": 1,
            "radio.relay.buffer_mbytes": 1,
        }
        with_it, without = (
            optimize(small_plan(changes | {"radio.causal": causal})) for causal in (True, False)
        )
        assert with_it.delivered_rate >= without.delivered_rate - 1e-4
        assert with_it.relayed.queue.max() <= 8 / with_it.plan.flight.time_step


def test_shares_are_saved_and_read(small_plan: MakePlan, tmp_path: Path) -> None:
    path = tmp_path / "result.npz"
    solution = optimize(small_plan({"radio.causal": True, "radio.duplex": "half"}))
    save_solution(solution, path)
    loaded = load_solution(path)
    assert solution.shares is not None
    assert loaded.shares is not None
    assert loaded.shares.tobytes() == solution.shares.tobytes()
    assert loaded.delivered_rate == solution.delivered_rate
    with np.load(path) as archive:
        assert archive["forwarded"].mean() == solution.delivered_rate == archive["R_del"]
        np.savez(tmp_path / "other.npz", **{**archive, "shares": archive["shares"] + 0.5})
    with pytest.raises(InputError, match=r"shares: expected a number of 0 to 1"):
        load_solution(tmp_path / "other.npz")
