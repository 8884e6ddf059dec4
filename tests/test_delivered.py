"""What a relay delivers, told by everything around the optimiser."""

import csv
import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import MakePlan

from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.pricing import fresh_rates, saturation
from faao_mav.optimizer.solution import Solution
from faao_mav.radio.relay import forward_greedily
from faao_mav.report import summary
from faao_mav.report.figures import plan_figures
from faao_mav.schedule.precoder_table import precoder_table
from faao_mav.schedule.prediction import price_flight
from faao_mav.workflow import Result, plan_mission

BAND = {"radio.fading": "none", "radio.bandwidth_mhz": 20}
KINDS: list[dict[str, Any]] = [
    {},
    {"radio.causal": True, "radio.duplex": "half"},
    {"radio.causal": True, "radio.relay.buffer_mbytes": 30},
]


@pytest.fixture(scope="module")
def half(small_plan: MakePlan) -> Solution:
    return optimize(small_plan({"radio.causal": True, "radio.duplex": "half"}))


@pytest.mark.parametrize("kind", KINDS)
def test_everything_tells_the_same(small_plan: MakePlan, kind: dict[str, Any]) -> None:
    result = plan_mission(small_plan(BAND | kind))
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

    # the queue is in megabytes of a bit/s/Hz for half a second on 20 MHz
    (axes,) = next(each.figure.axes for each in plan_figures(result) if each.heading == "Queue")
    assert axes.get_ylabel() == "waiting, megabytes"
    lines = {str(line.get_label()): np.asarray(line.get_ydata()) for line in axes.lines}
    assert lines["planned"] == pytest.approx(1.25 * solution.relayed.queue)
    if "buffer" in lines:
        assert lines["planned"].max() <= 30 + 1e-6
    assert ("buffer" in lines) == ("radio.relay.buffer_mbytes" in kind)

    # the mission is judged by it
    assert result.check is not None
    link = result.check.link
    assert link is not None
    assert link.planned_delivered == solution.delivered_rate
    assert link.predicted_delivered == pytest.approx(flown.delivered_rate, rel=1e-2)
    assert link.predicted_mbytes == pytest.approx(25 * link.predicted_delivered)
    worse = replace(link, predicted_rate=0.5 * link.planned_rate)
    assert worse.share == (link.share if link.causal else 0.5)
    worse = replace(link, predicted_delivered=0.4 * link.planned_delivered)
    assert worse.share == pytest.approx(0.4)

    # the planned flight delivers the plan
    t = np.append(solution.t, solution.t[-1] + 30)
    planned = price_flight(solution, t, np.vstack([solution.w, solution.w[-1:]]))
    assert planned.delivered_rate == pytest.approx(solution.delivered_rate, abs=1e-9)


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
    full = optimize(small_plan({"radio.causal": True, "radio.fading": "none"}))
    assert "receive_share" not in precoder_table(full)
    told = Result(full).as_dict()
    assert told["delivered_rate"] > 0
    assert told["delivered_mbytes"] is told["mbit_per_second"] is None  # without a bandwidth


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
