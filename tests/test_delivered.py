"""What a relay delivers, told by everything around the optimiser."""

import csv
import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SMALL, MakePlan, edited
from typer.testing import CliRunner

from faao_mav.cli.main import app
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.pricing import fresh_rates, saturation
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import parse_plan
from faao_mav.radio.relay import forward_greedily
from faao_mav.report import summary
from faao_mav.report.figures import queue
from faao_mav.report.page import render_report
from faao_mav.schedule.precoder_table import precoder_table
from faao_mav.schedule.prediction import price_flight
from faao_mav.study import make_cases, run_study
from faao_mav.study.figure import study_figure
from faao_mav.workflow import Result, plan_mission

BAND = {"radio.fading": "none", "radio.bandwidth_mhz": 20}
KINDS: list[dict[str, Any]] = [
    {},
    {"radio.causal": True},
    {"radio.causal": True, "radio.duplex": "half"},
    {"radio.causal": True, "radio.relay.buffer_mbytes": 30},
    {"radio.duplex": "half"},
]


@pytest.fixture(scope="module", params=range(len(KINDS)))
def result(request: pytest.FixtureRequest, small_plan: MakePlan) -> Result:
    return plan_mission(small_plan(BAND | KINDS[request.param]))


@pytest.fixture(scope="module")
def half(small_plan: MakePlan) -> Solution:
    return optimize(small_plan({"radio.causal": True, "radio.duplex": "half"}))


def test_json_has_what_is_delivered_planned_and_predicted(result: Result) -> None:
    told, solution = result.as_dict(), result.solution
    assert told["delivered_rate"] == solution.delivered_rate <= told["average_rate"] + 1e-12
    # bit/s/Hz on 20 MHz for 10 s, 8 bits a byte
    assert told["delivered_mbytes"] == pytest.approx(25 * solution.delivered_rate)
    assert told["mbit_per_second"]["average_rate"] == pytest.approx(20 * told["average_rate"])
    predicted, flown = told["predicted"], result.prediction
    assert flown is not None
    assert predicted["delivered_rate"] == flown.delivered_rate == flown.relayed.rate
    assert predicted["delivered_mbytes"] == pytest.approx(25 * flown.delivered_rate)
    assert predicted["delivered_rate_by_position"] == flown.delivered_by_position


def test_without_a_bandwidth_there_are_no_megabytes(small_plan: MakePlan) -> None:
    told = Result(optimize(small_plan({"radio.fading": "none"}))).as_dict()
    assert told["delivered_rate"] > 0
    assert told["delivered_mbytes"] is told["mbit_per_second"] is None


@pytest.mark.usefixtures("unpainted")
def test_the_page_shows_the_queue(result: Result) -> None:
    page = render_report(result)
    assert "<h2>Queue</h2>" in page
    (axes,) = queue(result.solution, result.prediction).axes
    assert axes.get_ylabel() == "waiting, megabytes"
    lines = {str(line.get_label()): line for line in axes.lines}
    # megabytes of a bit/s/Hz for half a second on 20 MHz
    planned = np.asarray(lines["planned"].get_ydata())
    assert planned == pytest.approx(1.25 * result.solution.relayed.queue)
    assert ("buffer" in lines) == (result.solution.plan.radio.relay.buffer_mbytes is not None)
    if "buffer" in lines:
        assert planned.max() <= 30 + 1e-6


def test_a_mission_is_judged_by_what_it_delivers(result: Result) -> None:
    assert result.check is not None
    link, flown = result.check.link, result.prediction
    assert link is not None
    assert flown is not None
    assert link.planned_delivered == result.solution.delivered_rate
    assert link.predicted_delivered == pytest.approx(flown.delivered_rate, rel=1e-2)
    assert link.predicted_mbytes == pytest.approx(25 * link.predicted_delivered)
    worse = replace(link, predicted_rate=0.5 * link.planned_rate)
    assert worse.share == (link.share if link.causal else 0.5)
    assert replace(link, predicted_delivered=0.4 * link.planned_delivered).share == (
        pytest.approx(0.4)
    )


def test_the_planned_flight_delivers_the_plan(result: Result) -> None:
    solution = result.solution
    t = np.append(solution.t, solution.t[-1] + 30)
    flown = price_flight(solution, t, np.vstack([solution.w, solution.w[-1:]]))
    assert flown.delivered_rate == pytest.approx(solution.delivered_rate, abs=1e-9)


def test_a_late_flight_is_forwarded_with_the_shares_of_its_slots(half: Solution) -> None:
    assert half.shares is not None
    t = np.append(half.t, half.t[-1] + 30) + 1.0
    flown = price_flight(half, t, np.vstack([half.w, half.w[-1:]]))
    again = forward_greedily(half.shares * flown.I_U, (1 - half.shares) * flown.I_G)
    assert flown.relayed.forwarded == pytest.approx(again.forwarded)
    assert flown.delivered_rate < half.delivered_rate


def test_the_table_of_a_half_duplex_radio_has_the_shares(
    half: Solution, small_plan: MakePlan
) -> None:
    rows = list(csv.DictReader(io.StringIO(precoder_table(half))))
    assert half.shares is not None
    assert [float(row["receive_share"]) for row in rows] == pytest.approx(half.shares.tolist())
    full = precoder_table(optimize(small_plan({"radio.causal": True})))
    assert "receive_share" not in full


@pytest.mark.parametrize("duplex", ["full", "half"])
@pytest.mark.parametrize("csi", ["statistical", "instantaneous"])
def test_fresh_fading_is_forwarded_too(small_plan: MakePlan, duplex: str, csi: str) -> None:
    plan = small_plan({"radio.causal": True, "radio.duplex": duplex, "radio.csi": csi})
    solution = optimize(plan)
    fresh = fresh_rates(solution)
    assert fresh is not None
    assert 0 < fresh.delivered_error < 0.1
    error = 0.1 + 4 * fresh.delivered_error
    assert fresh.delivered == pytest.approx(solution.delivered_rate, abs=error)
    assert fresh.delivered <= fresh.average + 1e-9
    assert f"{fresh.delivered:.4f} +- " in summary(Result(solution, fresh=fresh), verbose=True)


def test_saturation_is_of_the_rate_that_is_planned_for(small_plan: MakePlan) -> None:
    strong = {"radio.base_station.power_dbm": 50, "radio.relay.power_dbm": 50,
              "radio.fading": "none", "radio.causal": True}  # fmt: skip
    full = saturation(optimize(small_plan(strong)))
    assert full.ceiling == pytest.approx(2 * 19 / 20)  # nothing is forwarded in the first slot
    assert 0 < full.spare_db < 300
    half = saturation(optimize(small_plan(strong | {"radio.duplex": "half"})))
    assert half.ceiling == pytest.approx(1.0)
    assert half.saturated


def test_a_study_varies_causality_and_draws_what_it_costs() -> None:
    text = edited(SMALL, {"radio.fading": "none", "optimizer.starts": ["straight"]})
    vary = {"flight.duration": (10, 12), "radio.causal": (True, False)}
    rows = run_study(make_cases(text, vary=vary), jobs=1)
    assert not any(row.error for row in rows)
    by = {(row.values["flight.duration"], row.values["radio.causal"]): row for row in rows}
    for duration in (10, 12):
        planned, paper = by[duration, True], by[duration, False]
        assert planned.delivered is not None
        assert paper.delivered is not None
        assert planned.delivered >= paper.delivered - 1e-4
        assert planned.delivered_mbytes is None
    figure = study_figure(rows, parse_plan(SMALL), "delivered")
    (plot,) = figure.axes
    assert [line.get_label() for line in plot.lines] == [
        "R_avg, planned for it",
        "delivered, planned for it",
        "delivered, planned for R_avg",
    ]


def test_the_command_saves_what_comes_and_goes(tmp_path: Path) -> None:
    path = tmp_path / "plan.yaml"
    path.write_text(edited(SMALL, BAND | {"radio.causal": True, "radio.duplex": "half"}))
    saved = tmp_path / "r.npz"
    done = CliRunner().invoke(app, [str(path), "--save", str(saved), "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    with np.load(saved) as archive:
        received, forwarded, waiting = (archive[n] for n in ("received", "forwarded", "queue"))
        assert archive["shares"].shape == received.shape == (20,)
        assert archive["R_del"] == told["delivered_rate"]
    assert np.diff(waiting) == pytest.approx((received - forwarded)[:-1], abs=1e-12)
    assert forwarded.mean() == pytest.approx(told["delivered_rate"])
