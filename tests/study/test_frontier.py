"""The trade-off of a plan: its points are those that no other point is better than."""

import json
from pathlib import Path

import pytest
from conftest import SMALL, edited
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from faao_mav.cli.main import app
from faao_mav.errors import InputError
from faao_mav.plan import parse_plan
from faao_mav.plan.keys import POWER
from faao_mav.study.figure import frontier_table, pareto
from faao_mav.study.rows import StudyRow
from faao_mav.study.sweep import frontier_cases, parse_frontier

points = st.tuples(st.integers(0, 9), st.none() | st.integers(0, 9))


@given(st.lists(points, max_size=12))
def test_no_point_is_better_than_one_of_the_frontier(
    all_points: list[tuple[int, int | None]],
) -> None:
    rows = [
        StudyRow("", {POWER: power}, "faao", 0, delivered=data, delivered_mbytes=data)
        for power, data in all_points
    ]
    best = {(row.values[POWER], row.delivered) for row in pareto(rows, POWER)}
    there = {(power, data) for power, data in all_points if data is not None}
    assert best == {
        (power, data)
        for power, data in there
        if not any(p <= power and d >= data and (p, d) != (power, data) for p, d in there)
    }


def test_the_table_has_the_points_of_the_frontier() -> None:
    plan, key = parse_plan(edited(SMALL, {"radio.bandwidth_mhz": 1})), "flight.duration"
    rows = [
        StudyRow("", {key: T}, "faao", 0, delivered=0.5, delivered_mbytes=data, error=error)
        for T, data, error in ((8.0, 3.0, ""), (9.0, 2.5, ""), (10.0, 4.0, "late"))
    ]
    lines = frontier_table(rows, plan, key).splitlines()
    assert lines[0].split() == ["duration,", "s", "delivered,", "megabytes", "bit/s/Hz"]
    assert [line.split() for line in lines[1:3]] == [["8", "3", "0.5000"], ["10", "4", "0.5000"]]
    assert lines[3] == "1 of 3 points failed, first: late"


def test_the_cases_end_at_the_plan() -> None:
    plan = parse_plan(edited(SMALL, {"radio.relay.power_dbm": 7.5, "goal": {"maximise": "rate"}}))
    times = [parse_plan(case.text) for case in frontier_cases(plan, "flight.duration", 4)]
    assert [each.flight.duration for each in times][-1] == plan.flight.duration
    assert all(each.powers == plan.powers for each in times)
    powers = [parse_plan(case.text) for case in frontier_cases(plan, POWER, 3)]
    assert powers[-1].powers == pytest.approx(plan.powers)
    assert powers[0].powers == pytest.approx([power / 100 for power in plan.powers])


def test_other_trade_offs_are_refused() -> None:
    for text in ("power", "data,power", "mass,data", "power,data,data"):
        with pytest.raises(InputError, match=r"--frontier .*duration,data or power,data"):
            parse_frontier(text)


def test_a_frontier_is_drawn_and_told(tmp_path: Path) -> None:
    plan = tmp_path / "plan.yaml"
    plan.write_text(
        edited(SMALL, {"radio.fading": "none", "radio.bandwidth_mhz": 1, "flight.time_step": 1})
    )
    run = ["study", str(plan), "--frontier", "duration,data", "--points", "3", "--jobs", "1"]
    told = CliRunner().invoke(app, [*run, "--out", str(tmp_path / "out"), "--json"])
    assert told.exit_code == 0, told.output
    assert (tmp_path / "out" / "figure.svg").stat().st_size > 10_000
    rows = json.loads(told.stdout)["rows"]
    amounts = [row["delivered_mbytes"] for row in rows]
    assert amounts == sorted(amounts)
    assert rows[-1]["flight.duration"] == parse_plan(plan.read_text()).flight.duration
    refused = CliRunner().invoke(app, [*run, "--power", "1,2"])
    assert refused.exit_code == 2
