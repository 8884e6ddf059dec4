"""What radios are told in flight: the slot that is due, by time or by place, once."""

import json
import runpy
import threading
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from conftest import FLYABLE, edited, free_port

from faao_mav import optimize, parse_plan
from faao_mav.errors import InputError
from faao_mav.fly.fly import Radios
from faao_mav.optimizer.solution import Solution
from faao_mav.validate.flown import Line

TO = "udp:127.0.0.1:5005"


@cache
def solved(fading: str) -> Solution:
    return optimize(parse_plan(edited(FLYABLE, {"radio.fading": fading})))


def flight(solution: Solution, late: float) -> Line:
    """Return the planned flight so many seconds late, five samples a slot."""
    t = np.arange(-5.0, solution.t[-1] + 5.0, 0.1)
    return Line(t, Line.planned(solution).at(t - late), t)


def told(solution: Solution, flown: Line) -> list[dict[str, Any]]:
    """Return what a radio is told in a flight."""
    radios = Radios(solution, TO)
    lines = (radios.line(t, w) for t, w in zip(flown.t.tolist(), flown.w, strict=True))
    return [json.loads(line) for line in lines if line is not None]


@pytest.mark.parametrize(("fading", "behind"), [("none", 4), ("realization", 0)])
def test_slots_are_taken_by_place_unless_their_draws_are_known(fading: str, behind: int) -> None:
    shares = np.linspace(0, 1, len(solved(fading).t))
    solution = replace(solved(fading), shares=shares)
    lines = told(solution, flight(solution, late=2.0))
    slots = [line["slot"] for line in lines]
    assert slots == sorted(set(slots))
    step, duration = solution.plan.flight.time_step, solution.plan.flight.duration
    for line in lines:
        assert 0 <= line["t"] < duration
        if line["t"] > 4:
            assert int(line["t"] / step + 1e-9) - line["slot"] == pytest.approx(behind, abs=1)
        P = np.array(line["P_B"])
        assert np.array_equal(P[..., 0] + 1j * P[..., 1], solution.P_B[line["slot"]])
        assert line["receive_share"] == pytest.approx(shares[line["slot"]])


def test_before_the_clock_is_known_slots_go_by_place_near_the_start() -> None:
    solution = solved("realization")
    radios = Radios(solution, TO)
    assert radios.line(None, solution.w[0] + [30.0, 0.0]) is None
    line = radios.line(None, solution.w[0])
    assert line is not None
    assert (json.loads(line)["slot"], json.loads(line)["t"]) == (0, None)
    assert radios.line(None, solution.w[0]) is None  # told once
    assert radios.line(solution.plan.flight.duration + 1, solution.w[-1]) is None


def test_radios_that_cannot_be_told() -> None:
    solution = solved("none")
    with pytest.raises(InputError, match="csi"):  # precoders that know their draw are no slots
        Radios(replace(solution, P_B=solution.P_B[None]), TO)
    for to in ("udp:127.0.0.1", "tcp:127.0.0.1:5005", "udp:127.0.0.1:70000"):
        with pytest.raises(InputError, match="expected udp:HOST:PORT"):
            Radios(solution, to)


def test_the_receiver_of_the_examples_receives() -> None:
    solution, port = solved("none"), free_port()
    scope = runpy.run_path("docs/examples/radio_receiver.py")
    done = threading.Event()

    def tell() -> None:
        while not done.wait(0.02):
            Radios(solution, f"udp:127.0.0.1:{port}").tell(0.0, solution.w[0])

    teller = threading.Thread(target=tell)
    teller.start()
    try:
        slot, P_B, P_U = next(scope["slots"](port))
    finally:
        done.set()
        teller.join()
    assert slot == 0
    assert np.array_equal(P_B, solution.P_B[0])
    assert np.array_equal(P_U, solution.P_U[0])
