"""What a study runs: values, grids, and the plans that they make; the trade-off of a plan."""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from conftest import MISSIONS, SMALL, edited
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from faao_mav.cli.main import app
from faao_mav.errors import InputError, PlanError
from faao_mav.plan import parse_plan, read_plan
from faao_mav.study import make_cases, parse_vary
from faao_mav.study.rows import StudyRow, comparison
from faao_mav.study.sweep import MAX_ROWS, frontier_cases, parse_values


@given(
    start=st.integers(-1000, 1000),
    step=st.integers(1, 50),
    count=st.integers(0, 40),
    rest=st.floats(0, 0.99),
    digits=st.integers(0, 4),
)
def test_a_range_has_its_ends_and_equal_steps(
    start: int, step: int, count: int, rest: float, digits: int
) -> None:
    scale = 10**digits
    stop = start + step * count + int(rest * step)
    text = ":".join(f"{Fraction(n, scale).numerator / Fraction(n, scale).denominator:.{digits}f}"
                    for n in (start, stop, step))  # fmt: skip
    values = parse_values(text, "--power")
    assert values == tuple((start + k * step) / scale for k in range(count + 1))


@given(st.text(max_size=30))
def test_any_text_is_values_or_a_message(text: str) -> None:
    try:
        assert parse_values(text, "--power")
    except InputError as error:
        assert "--power" in str(error)


def test_values_are_those_of_yaml_and_others_are_refused() -> None:
    assert parse_values("-40:0:5", "--power") == tuple(range(-40, 1, 5))
    assert parse_values("10:0:-4", "--power") == (10, 6, 2)
    assert parse_values("1, 5:7:1, 2.5", "--power") == (1, 5, 6, 7, 2.5)
    assert parse_vary("flight.start=[0, 350],[0,100]")[1] == ([0, 350], [0, 100])
    assert parse_vary("radio.causal=false,true")[1] == (False, True)
    for text, part in (
        ("radio.modulation", "key=start:stop:step"),
        ("flight.duration=", "neither"),
        ("flight.duration=1:2", "no range"),
        ("flight.duration=1:2:0", "no range"),
        ("flight.duration=1:2:-1", "steps that come from start to stop"),
        ("flight.duration=1:inf:1", "no range"),
        ("flight.duration=1:2:inf", "no range"),
        ("flight.duration=0:1:1e-9", "1e+09 rows; a study has at most 100,000"),
        ("flight.duration=0:1e999999:1e-999999", "no range"),
        ("flight.duration=1e999999:1e999999:1", "no range"),
        ("flight.duration=0:1:1e-999999", "no range"),
        ("\x1b[2J=", r"--vary \x1b[2J: '' is neither"),
        ("k" * 1000 + "=", "--vary " + "k" * 57 + "...: '' is neither"),
        ("flight.duration=1], more: [2", "neither"),
    ):
        with pytest.raises(InputError) as caught:
            parse_vary(text)
        assert part in str(caught.value)
    with pytest.raises(InputError, match="at most 100,000"):
        make_cases(SMALL, vary={"radio.seed": tuple(range(MAX_ROWS // 2 + 1))}, seeds=2)
    for keys in (("radio.relay.power_dbm", "power_dbm"), ("radio.gain", "radio.gain.exponent"),
                 ("study.seeds",)):  # fmt: skip
        with pytest.raises(InputError, match=f"vary {keys[-1]}: .* sets the same; leave one out"):
            make_cases(SMALL, vary=dict.fromkeys(keys, (1,)))


def test_schemes_and_the_grid_of_every_plan_once() -> None:
    with pytest.raises(PlanError, match="'rzf' is not accepted; give a list of faao"):
        parse_plan(edited(SMALL, {"study": {"schemes": ["rzf"]}}))
    cases = make_cases(SMALL, vary={}, schemes=("faao", "algorithm1", "mrt"))
    made = [parse_plan(case.text).optimizer for case in cases]
    assert [each.method for each in made] == ["direct", "algorithm1", "direct"]
    assert [each.precoder for each in made] == ["faao", "faao", "mrt"]
    cases = make_cases(
        SMALL,
        vary={"power_dbm": [*np.array([0, 10])], "radio.modulation": ("bpsk", "qpsk")},
        schemes=("faao", "gaussian"),
        seeds=3,
    )
    assert len({case.key for case in cases}) == len(cases) == 2 * 2 * 2 * 3
    for case in cases:
        plan, values = parse_plan(case.text), dict(case.values)
        watts = 10 ** ((values["power_dbm"] - 30) / 10)
        assert plan.radio.base_station.power == plan.radio.relay.power == pytest.approx(watts)
        assert plan.radio.modulation == values["radio.modulation"]
        assert plan.optimizer.inputs == ("gaussian" if case.scheme == "gaussian" else "alphabet")
        assert plan.radio.seed == case.seed in (0, 1, 2)
        assert plan.study is None


def test_the_same_work_has_the_same_key_whatever_the_study() -> None:
    wide = make_cases(SMALL, vary={"radio.rician_factor": (1, 2, 3)})
    narrow = make_cases(SMALL + "study: {seeds: 4}\n", vary={"radio.rician_factor": (2,)})
    assert narrow[0].key == wide[1].key


def test_the_study_of_a_plan() -> None:
    text = SMALL + "study: {vary: {flight.duration: [10, 12]}, schemes: [faao, zf], seeds: 2}\n"
    study = parse_plan(text).study
    assert study is not None
    assert study.vary == {"flight.duration": (10, 12)}
    assert (study.schemes, study.seeds, study.figure) == (("faao", "zf"), 2, "delivered")
    assert parse_plan(SMALL).study is None


def test_sample_studies_are_of_section_iv() -> None:
    paper = read_plan(MISSIONS / "paper_active.yaml")
    for name in ("paper_fig3", "paper_fig4", "gaussian_cost"):  # of Section IV
        plan = read_plan(MISSIONS / f"{name}.yaml")
        assert plan.study is not None
        assert (plan.flight.start, plan.flight.end) == (paper.flight.start, paper.flight.end)
        assert (plan.vehicle, plan.powers) == (paper.vehicle, paper.powers)
        assert plan.radio.relay.noise >= paper.radio.relay.noise
        for case in make_cases(plan.text, vary=plan.study.vary, schemes=plan.study.schemes):
            assert parse_plan(case.text).flight.altitude == 100


def test_the_points_of_a_frontier_end_at_the_plan() -> None:
    plan = parse_plan(edited(SMALL, {"radio.relay.power_dbm": 7.5, "goal": {"maximise": "rate"}}))
    times = [parse_plan(case.text) for case in frontier_cases(plan, "duration,data", 4, vary={})]
    assert [each.flight.duration for each in times][-1] == plan.flight.duration
    assert all(each.powers == plan.powers and not each.goal.maximise for each in times)
    vary, schemes = {"radio.modulation": ("bpsk", "qpsk")}, ("faao", "mrt")
    cases = frontier_cases(plan, "power, data", 3, vary=vary, schemes=schemes)
    powers = [parse_plan(case.text) for case in cases[::4]]
    assert powers[-1].powers == pytest.approx(plan.powers)
    assert powers[0].powers == pytest.approx([power / 100 for power in plan.powers])
    assert [case.scheme for case in cases] == ["faao", "mrt"] * 6
    own = ("radio.base_station.power_dbm", -10.0)
    assert cases[2].values == (own, ("radio.modulation", "qpsk"))
    with pytest.raises(InputError, match="sets the same"):
        frontier_cases(plan, "power,data", 3, vary={"radio.relay.power_dbm": (1,)})


def test_other_trade_offs_are_refused() -> None:
    for text in ("power", "data,power", "mass,data", "power,data,data"):
        with pytest.raises(InputError, match=r"--frontier .*duration,data or power,data"):
            frontier_cases(parse_plan(SMALL), text, 3, vary={})


def test_data_is_megabytes_or_without_a_bandwidth_bits_of_a_hertz() -> None:
    rows = [
        StudyRow("", {"T": T}, "faao", 0, delivered=0.5, duration=T, error=error)
        for T, error in ((8.0, ""), (10.0, "late"))
    ]
    lines = comparison(rows, data=True).splitlines()[-5:]
    assert [line.split() for line in lines[:3]] == [
        ["data,", "bit/Hz"],
        ["T", "faao"],
        ["8.0", "4.0000"],
    ]
    assert lines[4] == "1 of 2 rows failed, first: late"
    assert replace(rows[0], delivered_mbytes=3.0).data == 3.0


def test_a_frontier_is_drawn_by_the_command(tmp_path: Path) -> None:
    plan = tmp_path / "plan.yaml"
    plan.write_text(
        edited(SMALL, {"radio.fading": "none", "radio.bandwidth_mhz": 1, "flight.time_step": 1})
    )
    run = ["study", str(plan), "--frontier", "duration,data", "--points", "3", "--jobs", "1"]
    told = CliRunner().invoke(app, [*run, "--out", str(tmp_path / "out"), "--json"])
    assert told.exit_code == 0, told.output
    drawn = (tmp_path / "out" / "figure.svg").read_text()
    assert "delivered, megabytes" in drawn
    assert "duration T, s" in drawn
    rows = json.loads(told.stdout)["rows"]
    amounts = [row["delivered_mbytes"] for row in rows]
    assert amounts == sorted(amounts)
    assert rows[-1]["flight.duration"] == parse_plan(plan.read_text()).flight.duration
    told = CliRunner().invoke(app, [*run, "--schemes", "mrt"])
    assert "data, megabytes\nduration     mrt\n" in told.stdout
    refused = CliRunner().invoke(app, [*run, "--vary", "flight.duration=8"])
    assert refused.exit_code == 2
