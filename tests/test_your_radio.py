"""The radio as it is: its law and rates from a plan or a file beside it, and parts of one's own."""

import csv
import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import MISSIONS, SMALL, edited

from faao_mav.arrays import Real
from faao_mav.errors import InputError, PlanError
from faao_mav.fly.fly import Radios
from faao_mav.optimizer.design import design
from faao_mav.optimizer.interior.maximize import objective
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.search.bound import upper_bound
from faao_mav.optimizer.solution import load_solution, save_solution
from faao_mav.plan import Plan, parse_plan, read_plan
from faao_mav.radio.gain import GainField, GainFunction, PathGain
from faao_mav.radio.precoder import SCHEMES
from faao_mav.radio.rate_steps import StreamRate
from faao_mav.report.page import render_report
from faao_mav.schedule.precoder_table import precoder_table
from faao_mav.workflow import Result, plan_mission

LINK = """
# fitted to three flights
reference_gain_db: -44.5
exponent: 2.0
elevation_db: [18, -30, 10]
spread_db: 5.5
correlation_m: 42
about: three flights of May
"""


def written(folder: Path, changes: dict[str, Any], link: str = LINK) -> Path:
    """Write a plan with these `changes` into `folder`, and link.yaml beside it."""
    (folder / "link.yaml").write_text(link)
    plan = folder / "plan.yaml"
    plan.write_text(edited(SMALL, changes))
    return plan


SIDE = np.arange(-50.0, 351.0, 20.0)
MAP: dict[str, Any] = {
    "east": SIDE,
    "north": SIDE,
    "height": np.array([60.0, 100.0]),
    "gain_db": -90.0 - np.arange(2.0)[:, None, None] - SIDE / 100 + np.zeros((2, 21, 21)),
}
ABOVE = {"above_law_db" if key == "gain_db" else key: value for key, value in MAP.items()}


def mapped(folder: Path, arrays: dict[str, Any], changes: dict[str, Any]) -> Path:
    """Write a plan and the file of a map beside it."""
    (folder / "maps").mkdir(exist_ok=True)
    np.savez(folder / "maps" / "m.npz", **arrays)
    return written(folder, changes, link="exponent: 2.5\nmap: maps/m.npz\n")


def test_a_map_stands_in_the_text_of_a_plan(tmp_path: Path) -> None:
    """Of one hop, by way of a law's file, and with a result that is saved."""
    changes = {"flight.altitude": 70, "radio.ground_user.gain": {"map": "maps/m.npz"}}
    plan = read_plan(mapped(tmp_path, MAP, changes))
    assert plan.map_edge == ((-50.0, -50.0), (350.0, 350.0))
    assert parse_plan(plan.text).radio == plan.radio  # without the file
    assert plan.changed({"flight.start": [40, 1]}).radio == plan.radio
    problem = build_problem(plan)
    assert problem.bs_uav.gains.above is None
    gains = problem.uav_user.gains.gain(np.array([[100.0], [30.0]]))
    assert 10 * np.log10(gains) == pytest.approx(-91.25)
    solution = optimize(plan)
    save_solution(solution, tmp_path / "r.npz")
    assert load_solution(tmp_path / "r.npz").problem.plan.radio == plan.radio
    page = render_report(Result(solution))
    assert max(map(len, re.findall("npz:.*", page))) < 100
    law = read_plan(mapped(tmp_path, ABOVE, {"radio.gain": "link.yaml"}))
    assert law.map_edge is None
    for link in build_problem(law).links:
        assert link.gains.law.db(np.array([30.0]), 40.0) == pytest.approx(-50 - 25 * np.log10(50))
        assert link.gains.above is not None
    square = {"optimizer.method": "algorithm1", "radio.gain.exponent": 2, "radio.fading": "none"}
    with pytest.raises(PlanError, match=r"radio\.gain is not for algorithm1"):
        optimize(law.changed(square | {"radio.causal": False}))


TABLE = """# two columns count
mcs, SNR_dB, "mbit_per_s"
2, 12, 26
0, 4, 6.5
1, 7, 13
"""
WIFI = {"radio.rates": "rates.csv", "radio.bandwidth_mhz": 20}


def tabled(folder: Path, changes: dict[str, Any] | None = None, table: str = TABLE) -> Path:
    """Write a plan with the rates of a table into `folder`."""
    (folder / "rates.csv").write_text(table)
    return written(folder, WIFI | (changes or {}))


def test_laws_and_rates_of_files_are_in_the_text_of_the_plan(tmp_path: Path) -> None:
    plan = read_plan(tabled(tmp_path, table=f"{TABLE}3, 14, 26\n"))  # no more than at 12 dB
    steps = plan.radio.rate_steps
    assert steps is not None
    assert (steps.snr_db, steps.rates) == ((4, 7, 12), (0.325, 0.65, 1.3))
    assert parse_plan(plan.text).radio == plan.radio  # without the file
    in_hertz = TABLE.replace("mbit_per_s", "bit_per_s_per_hz")
    steps = read_plan(tabled(tmp_path, table=in_hertz)).radio.rate_steps
    assert steps is not None
    assert steps.rates == (6.5, 13, 26)
    both = read_plan(written(tmp_path, {"radio.gain": "link.yaml"}))
    for law in both.radio.path_gains:
        assert law.reference_gain == pytest.approx(10**-4.45)
        assert law.elevation_db == (18, -30, 10)
    assert parse_plan(both.text).radio == both.radio  # without the file
    one = read_plan(written(tmp_path, {"radio.ground_user.gain": "link.yaml"}))
    assert one.radio.path_gains[0] == PathGain(one.radio.reference_gain)
    assert one.radio.gain_laws[1].spread_db == 5.5


WRONG_LAWS = (
    ("exponents: 2\n", "link.yaml: exponents: unknown key; did you mean exponent?"),
    ("elevation_db: [1, 2, 3, 4]\n", "link.yaml: elevation_db: [1, 2, 3, 4] is not accepted"),
    ("reference_gain_db: -20\nelevation_db: [90]\n", "radio.gain: 37.96 dB at 40 m"),
    ("- 2.0\n", "link.yaml: "),
    ("exponent: [2\n", "link.yaml: line 2"),
)
WRONG_MAPS: tuple[tuple[dict[str, Any], dict[str, Any], str], ...] = (
    ({}, {"flight.start": [-60, 0]}, "flight.start: [-60.0, 0.0] is off radio.gain.map: -50"),
    ({}, {"flight.end": [0, 400]}, "flight.end: [0.0, 400.0] is off radio.gain.map: -50 to 3"),
    ({}, {"radio.gain.exponent": 3}, "radio.gain.exponent: 3.0: radio.gain.map is the gain"),
    ({}, {"radio.gain.elevation_db": [1]}, "radio.gain.elevation_db: (1.0,): radio.gain.map"),
    ({}, {"radio.gain.reference_gain_db": -40}, "radio.gain.reference_gain_db: -40.0: "),
    ({}, {"radio.ground_user.velocity": [1, 0]}, "radio.ground_user: moves, and radio.gain.m"),
    ({"gain_db": np.full((2, 21, 21), 3.0)}, {}, "radio.gain.map: 3 dB is more than was"),
    ({"gain_db": np.full((2, 21, 21), np.nan)}, {}, "radio.gain.map: no aircraft can be"),
    ({"ground": np.full((21, 21), 99.0)}, {}, "no aircraft can be on it at 40 m (flight"),
    ({"origin": np.array([47.0, 8.0])}, {}, "maps/m.npz: origin: 47, 8 lies "),
    ({"east": SIDE[:9]}, {}, "m.npz: gain_db: 2 x 21 x 21 of float64; expected 2 x"),
)
WRONG_TABLES = (
    ("", "line 1: columns ''; give a header with snr_db and mbit_per_s, or"),
    ("snr,rate\n1,2\n", "line 1: columns 'snr, rate'"),
    ("snr_db,mbit_per_s,bit_per_s_per_hz\n1,2,3\n", "line 1: columns"),
    ("# x\nsnr_db,mbit_per_s\n1,2\n3,fast\n", "line 4: mbit_per_s: 'fast' is no number"),
    ("snr_db,mbit_per_s\n1\n", "line 2: mbit_per_s: '' is no number"),
    ("snr_db,mbit_per_s\n", "the rates are missing"),
)


def test_what_is_wrong_in_a_file_or_with_it_is_told_in_one_line(tmp_path: Path) -> None:
    mapping = {"radio.gain.map": "maps/m.npz"}

    def cases() -> Iterator[tuple[Path, str]]:
        for link, told in WRONG_LAWS:
            yield written(tmp_path, {"radio.gain": "link.yaml"}, link), told
        for arrays, changes, told in WRONG_MAPS:
            yield mapped(tmp_path, MAP | arrays, mapping | changes), told
        for table, told in WRONG_TABLES:
            yield tabled(tmp_path, table=table), told

    for plan, told in cases():
        with pytest.raises(PlanError) as caught:
            read_plan(plan)
        message = str(caught.value)
        assert told in message
        assert message.startswith(f"{plan}: ")
        assert len(message.splitlines()) == 1


STAIRS: tuple[dict[str, Any], ...] = (
    {"radio.fading": "ergodic", "radio.fading_samples": 8},
    {"radio.fading": "realization", "radio.relay.antennas": 1, "radio.gain.exponent": 2.05},
    {"radio.causal": True, "radio.duplex": "half", "flight.altitude": 80},
    {"radio.gain.elevation_db": [18, -30, 10], "radio.causal": True},
)
FAINT = {
    "radio.base_station.power_dbm": -5,
    "radio.relay.power_dbm": -3,
    "flight.duration": 30,
    "optimizer.starts": ["straight", "bs-user"],
}


@pytest.mark.usefixtures("coarse_map")
@pytest.mark.parametrize("changes", STAIRS)
def test_what_is_priced_is_what_was_maximised(tmp_path: Path, changes: dict[str, Any]) -> None:
    """Steps along the flight, and the same that rise over half a decibel; no bound is below."""
    plan = read_plan(tabled(tmp_path, {"radio.fading": "none"} | FAINT | changes))
    solution = optimize(plan)
    problem, queue = solution.problem, solution.problem.maximised_queue
    field = rate_field(problem, design(plan), 0.5)
    smooth = objective(field.value(solution.w.T), problem.kinematics, queue)
    priced = solution.delivered_rate if queue else solution.rates.R_avg
    assert priced == pytest.approx(smooth, rel=0.01)
    assert (np.diff(solution.history) >= 0).all()
    assert solution.residuals()["(9) rate"] < 1e-12
    if plan.radio.fading != "ergodic":
        steps = solution.steps  # each slot has its own
        assert steps is not None
        rates = np.array([0, 0.325, 0.65, 1.3])
        np.testing.assert_allclose(rates[steps[0]], solution.I_U)
        np.testing.assert_allclose(rates[steps[1]], solution.I_G)
        rows = list(csv.DictReader(precoder_table(solution).splitlines()))
        assert [int(row["step_U"]) for row in rows] == steps[1].tolist()
        line = Radios(solution, "udp:127.0.0.1:9").line(3.0, solution.w[6])
        assert line is not None
        assert json.loads(line)["step_B"] == steps[0][6]
    assert priced <= upper_bound(problem).value


@dataclass(frozen=True)
class Same(GainFunction):
    """The law of a plan, told by its values alone."""

    law: PathGain

    def log(self, squared_distance: Real, height: float | Real) -> Real:
        return self.law.log(squared_distance, height)


class Shannon(StreamRate):
    """Up to six bits, by the logarithm."""

    most = 6.0

    def value(self, snr: Real) -> Real:
        return self.most * (1 - np.exp(-np.log2(1 + snr) / self.most))


def sample(**changes: object) -> Plan:
    text = (MISSIONS / "copter_relay.yaml").read_text()
    return parse_plan(text).changed({"flight.time_step": 2, "flight.duration": 80, **changes})


OWN_LAW = {"exponent": 2.2, "elevation_db": [8.0, -12.0]}


def test_a_law_and_a_precoder_of_ones_own_are_as_the_plans() -> None:
    named = sample(**{"radio.gain": OWN_LAW, "optimizer.precoder": "mrt"})
    wanted = optimize(named)
    found = optimize(sample(), gain=Same(named.radio.path_gains[0]), precoder=SCHEMES["mrt"])
    assert found.delivered_rate == pytest.approx(wanted.delivered_rate, rel=1e-5)
    assert found.is_feasible(1e-6)
    with pytest.raises(InputError, match="precoder: has 4 times the power"):
        optimize(sample(), precoder=lambda H, W, noise: 2 * SCHEMES["mrt"](H, W, noise))
    with pytest.raises(InputError, match="expected finite numbers"):
        optimize(sample(), precoder=lambda H, *_: H[..., :1])
    endless = Shannon()
    endless.most = math.nan
    loud = Same(PathGain(1e5))
    wrong: dict[str, Any] = {"gains": loud, "gain: log": loud, "rate: value": endless}
    for name, part in wrong.items():
        with pytest.raises(InputError, match=f"^{name}: "):
            optimize(sample(), **{name.split(":")[0]: part})
    law, height = PathGain(1e-5, 2.4, (5.0, -30.0, 12.0)), 30.0
    away = np.random.default_rng(0).uniform(-300, 300, (2, 40))
    own, plans = (GainField(each, np.zeros(2), height) for each in (Same(law), law))
    for told, exact in zip(own.slopes(away), plans.slopes(away), strict=True):
        np.testing.assert_allclose(told, exact, rtol=1e-4, atol=1e-4 * np.abs(exact).max())
    told, exact = Same(law).turns(900.0, height), law.turns(900.0, height)
    np.testing.assert_allclose(told, exact, atol=900.0 / 499)


@pytest.mark.usefixtures("coarse_map")
def test_a_rate_of_ones_own_is_planned_priced_and_bounded() -> None:
    quiet = sample(**{"radio.fading": "none"})
    result = plan_mission(quiet, rate=Shannon(), bound=True)
    solution, (link, _) = result.solution, result.solution.problem.links
    d2 = np.sum((solution.w - link.gains.station) ** 2, axis=1) + link.gains.height**2
    # the arrays' full gain: of one stream over a line of sight of rank one
    snr = link.power / link.noise * quiet.radio.reference_gain / d2 * link.receive * link.transmit
    np.testing.assert_allclose(solution.I_U, Shannon().value(snr), rtol=1e-3)
    assert result.prediction is not None
    assert result.prediction.delivered_rate > 0.99 * solution.delivered_rate
    assert result.bound is not None
    assert result.bound.value >= solution.delivered_rate
    paper = {"optimizer.method": "algorithm1", "radio.fading": "none", "radio.causal": False}
    for changes in ({"goal": {"rate": 1.0, "minimise": "duration"}}, paper):
        with pytest.raises(InputError, match="rate: "):  # where it would be lost
            optimize(sample(**changes), rate=Shannon())
