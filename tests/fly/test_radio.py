"""What radios are told in flight: the slot that is due, by time or by place, once."""

import json
import socket
import threading
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import FLYABLE, edited, free_port
from pages import blocks
from typer.testing import CliRunner

from faao_mav import optimize, parse_plan
from faao_mav.cli.main import app
from faao_mav.errors import InputError
from faao_mav.fly.radio import RadioFeed, UdpRadio, replay, replayed
from faao_mav.optimizer.solution import Solution
from faao_mav.validate.flown import Line

LOGS = Path(__file__).parents[1] / "data" / "logs"


@cache
def solved(fading: str) -> Solution:
    return optimize(parse_plan(edited(FLYABLE, {"radio.fading": fading})))


def flight(solution: Solution, late: float) -> Line:
    """Return the planned flight so many seconds late, five samples a slot."""
    t = np.arange(-5.0, solution.t[-1] + 5.0, 0.1)
    return Line(t, np.stack([np.interp(t - late, solution.t, x) for x in solution.w.T], axis=-1))


@pytest.mark.parametrize(("fading", "behind"), [("none", 4), ("realization", 0)])
def test_slots_are_taken_by_place_unless_their_draws_are_known(fading: str, behind: int) -> None:
    solution = solved(fading)
    lines = [(t, json.loads(line)) for t, line in replayed(solution, flight(solution, late=2.0))]
    slots = [line["slot"] for _, line in lines]
    assert slots == sorted(set(slots))
    step = solution.plan.flight.time_step
    for t, line in lines:
        if t > 4:
            assert int(t / step + 1e-9) - line["slot"] == pytest.approx(behind, abs=1)
        at = [line["east"], line["north"]]
        P = np.array(line["P_B"])
        assert np.array_equal(P[..., 0] + 1j * P[..., 1], solution.P_B[line["slot"]])
        if fading == "none" and t > 4:
            nearest = np.linalg.norm(solution.w - at, axis=1).argmin()
            assert abs(nearest - line["slot"]) <= 1
    assert all(0 <= t < solution.plan.flight.duration for t, _ in lines)


def test_before_the_clock_is_known_slots_go_by_place_near_the_start() -> None:
    solution = solved("realization")
    feed = RadioFeed(solution)
    assert feed.line(None, solution.w[0] + [30.0, 0.0]) is None
    line = feed.line(None, solution.w[0])
    assert line is not None
    assert json.loads(line)["slot"] == 0
    assert json.loads(line)["t"] is None
    assert feed.line(None, solution.w[0]) is None  # told once
    assert feed.line(solution.plan.flight.duration + 1, solution.w[-1]) is None


def test_shares_come_with_their_slots() -> None:
    shares = np.linspace(0, 1, len(solved("none").t))
    solution = replace(solved("none"), shares=shares)
    for _, line in replayed(solution, flight(solution, late=0.0)):
        told = json.loads(line)
        assert told["receive_share"] == pytest.approx(shares[told["slot"]])


def test_precoders_that_know_their_draw_are_no_slots() -> None:
    solution = solved("none")
    with pytest.raises(InputError, match="csi"):
        RadioFeed(replace(solution, P_B=solution.P_B[None]))


@pytest.mark.parametrize("to", ["udp:127.0.0.1", "tcp:127.0.0.1:5005", "udp:127.0.0.1:70000"])
def test_where_radios_cannot_be(to: str) -> None:
    with pytest.raises(InputError, match="expected udp:HOST:PORT"):
        UdpRadio(to)


def test_a_replay_keeps_the_pace() -> None:
    slept, now, sent = list[float](), [100.0], list[str]()

    def sleep(seconds: float) -> None:
        slept.append(seconds)
        now[0] += seconds

    lines = iter([(5.0, "a"), (5.5, "b"), (7.0, "c")])
    assert replay(lines, sent.append, clock=lambda: now[0], sleep=sleep) == 3
    assert (sent, slept) == (["a", "b", "c"], [0.0, 0.5, 1.5])


def test_the_receiver_of_the_page_receives() -> None:
    solution, port = solved("none"), free_port()
    text = next(each.text for each in blocks("docs/flying.md") if "def slots" in each.text)
    scope: dict[str, Any] = {}
    exec(text, scope)
    line, done = RadioFeed(solution).line(0.0, solution.w[0]), threading.Event()
    assert line is not None

    def tell() -> None:
        radio = UdpRadio(f"udp:127.0.0.1:{port}")
        while not done.wait(0.02):
            radio.send(line)

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


def test_a_log_is_replayed_to_a_radio(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("faao_mav.workflow.with_mission", lambda result: result)
    monkeypatch.setattr(replay, "__kwdefaults__", {"clock": lambda: 0.0, "sleep": lambda _: None})
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as radio:
        radio.bind(("127.0.0.1", 0))
        radio.settimeout(5)
        to = f"udp:127.0.0.1:{radio.getsockname()[1]}"
        log, plan = str(LOGS / "arducopter.tlog"), str(LOGS / "plan.yaml")
        result = CliRunner().invoke(app, ["debrief", log, "--plan", plan, "--radio", to])
        assert result.exit_code == 0, result.output
        first = json.loads(radio.recv(65_536))
        assert "slots were told to udp:" in result.output
    assert first["slot"] == 0
    assert np.array(first["P_U"]).shape[-1] == 2
