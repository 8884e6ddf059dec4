"""What is delivered: the direct method beside CasADi + IPOPT with the same queue, in one run.

    pip install -e '.[bench]'
    python benchmarks/delivered_against_ipopt.py [--quick] [--random 20]

The peer starts from five routes by way of the stations, as far as there is time to fly them, and
`--random` ones. Rates are delivered rates in bit/s/Hz, computed for both by the same function from
the positions alone; steps of a radio's own rates rise as wide as at first. Seconds are those of the
processor for the search: without the tables of the rates, which the peer is given ready made, and
without the precoders of the flight that was found, which it does not seek; with the building of its
model. `whole` is all that `optimize` takes.
Everything printed is measured in the run.
"""

import argparse
import os
import time
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

os.environ.setdefault("OMP_NUM_THREADS", "1")  # as the command does

import numpy as np
from peer import delivered, peer_starts, sample

from faao_mav.optimizer import direct
from faao_mav.optimizer.design import design
from faao_mav.optimizer.interior.maximize import objective
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.plan import Plan

_FREE = {"flight.start_velocity": "free", "flight.end_velocity": "free"}
_HALF, _QAM = {"radio.duplex": "half"}, {"radio.modulation": "16qam"}
_WAVY = {"radio.gain": {"elevation_db": [18, -30, 10]}}
_STEEP = {"radio.gain": {"exponent": 2.6, "elevation_db": [6]}, "power": 30}
_APART = {
    "radio.base_station.gain": {"elevation_db": [0, 0, -40]},
    "radio.ground_user.gain": {"exponent": 2.4, "elevation_db": [-8, 12]},
    "power": 30,
}

PLANS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("copter_relay", {}),
    ("copter_relay", _HALF),
    ("copter_relay", {"flight.duration": 70}),
    ("copter_relay", {"flight.duration": 70} | _HALF),
    ("copter_relay", {"flight.duration": 200, "power": 0}),
    ("copter_relay", {"flight.duration": 300, "power": 5, "flight.time_step": 1}),
    ("copter_relay", _QAM | {"power": 17}),
    ("copter_relay", {"flight.duration": 90} | _QAM | {"power": 17} | _HALF),
    ("copter_relay", {"flight.duration": 150} | _FREE),
    ("copter_relay", {"radio.bandwidth_mhz": 20, "radio.relay.buffer_mbytes": 100}),
    ("copter_relay", {"radio.modulation": "8psk"}),
    ("copter_relay", _QAM),
    ("copter_relay", {"radio.modulation": "64qam"}),
    ("copter_relay", {"radio.modulation": "8psk", "antennas": 3}),
    ("copter_relay", _QAM | {"antennas": 3}),
    ("copter_relay", {"radio.modulation": "qpsk", "antennas": 4}),
    ("copter_relay", _WAVY),
    ("copter_relay", {"radio.gain": {"elevation_db": [0, -10, -30]}, "power": 10}),
    ("copter_relay", _STEEP | {"flight.duration": 200}),
    ("copter_relay", _APART),
    ("wifi_relay", {}),
    ("wifi_relay", _WAVY | {"power": 14}),
    ("fsk_relay", {"radio.fading": "ergodic", "flight.duration": 300}),
    ("paper_active", {"flight.duration": 40}),
    ("paper_active", {"flight.duration": 50, "power": 10}),
    ("paper_active", {"flight.duration": 50, "radio.gain": {"elevation_db": [0, -20, 10]}}),
    ("paper_active", {"flight.duration": 100, "power": 10}),
)


def by_direct(read: Plan) -> tuple[float, float, float]:
    """Return what the direct method delivers, and its seconds: of the search, and as a whole."""
    apart = 0.0

    def timed(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            nonlocal apart
            began = time.process_time()
            result = function(*arguments)
            apart += time.process_time() - began
            return result

        return call

    with (
        patch("faao_mav.optimizer.direct.rate_field", timed(rate_field)),
        patch.object(direct._Search, "precoders", timed(direct._Search.precoders)),
        patch.object(direct, "_WIDTHS", ()),  # steps of a radio's rates as wide as the peer's
    ):
        began = time.process_time()
        solution = optimize(read)
        took = time.process_time() - began
    if read.radio.rates is None:
        return solution.delivered_rate, took - apart, took
    problem = solution.problem
    values = rate_field(problem, design(read)).value(solution.w.T)
    return objective(values, problem.kinematics, problem.relay), took - apart, took


def main() -> None:
    """Print the table, then which claims hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the first three rows")
    parser.add_argument("--random", type=int, default=0, help="random starts of the peer")
    options = parser.parse_args()
    rows, random = PLANS[:3] if options.quick else PLANS, options.random
    print(f"{'plan':70} direct      s  whole    IPOPT       s  starts  ratio")
    above, ratios = np.inf, []
    for name, changes in rows:
        read = sample(name, {"radio.causal": True} | changes)
        problem = build_problem(read)
        optimize(read)  # fills the tables that are kept
        ours, took, whole = by_direct(read)
        flights, field = peer_starts(problem, random).values(), rate_field(problem, design(read))
        reached, seconds = delivered(problem, field, flights, 1e-4)
        peer = max(reached)
        above = min(above, ours - peer)
        ratios.append(sum(seconds) / took)
        told = ", ".join(f"{key.split('.')[-1]} {value}" for key, value in changes.items())
        print(
            f"{f'{name}: {told}':68}{ours:9.4f}{took:7.2f}{whole:7.2f}{peer:9.4f}"
            f"{sum(seconds):8.1f}{len(seconds):8}{ratios[-1]:7.1f}",
            flush=True,
        )
    for claim, met, figure in (
        ("never below IPOPT's best by 1e-4", above >= -1e-4, f"least gain {above:.1e}"),
        ("ten times quicker than the starts", min(ratios) >= 10, f"least ratio {min(ratios):.1f}"),
    ):
        print(f"{'met' if met else 'MISSED':8}{claim}: {figure}")


if __name__ == "__main__":
    main()
