"""What a flight that is not quite the planned one delivers, and the table a radio goes by."""

import csv
import io
from typing import Any

import numpy as np
import pytest
from conftest import MakePlan

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.solution import Solution
from faao_mav.radio.rate import cutoff_rate
from faao_mav.schedule.precoder_table import precoder_table, taken_by
from faao_mav.schedule.prediction import nearest_slots, price_flight, rates_along

FADINGS: list[dict[str, Any]] = [
    {"radio.fading": "none"},
    {"radio.fading": "realization"},
    {"radio.fading": "ergodic", "radio.fading_samples": 4},
    {"radio.fading": "ergodic", "radio.fading_samples": 4, "radio.csi": "instantaneous"},
]


@pytest.fixture(scope="module", params=range(len(FADINGS)))
def solution(request: pytest.FixtureRequest, small_plan: MakePlan) -> Solution:
    return optimize(small_plan(FADINGS[request.param]))


def held(solution: Solution, seconds: float = 30.0) -> tuple[Real, Real]:
    """The plan as a flight that stays at w_F afterwards, finely sampled."""
    t = np.arange(-5.0, solution.t[-1] + seconds, 0.05)
    return t, np.stack([np.interp(t, solution.t, x) for x in solution.w.T], axis=-1)


def test_the_plan_itself_delivers_the_plan(solution: Solution) -> None:
    found, duration = price_flight(solution, *held(solution)), solution.plan.flight.duration
    assert pytest.approx(solution.I_U, abs=1e-9) == found.I_U
    assert pytest.approx(solution.I_G, abs=1e-9) == found.I_G
    assert found.delivered_rate == pytest.approx(solution.delivered_rate, abs=1e-9)
    assert found.by_position.R_avg == pytest.approx(solution.rates.R_avg, abs=1e-9)
    assert found.duration == pytest.approx(duration, abs=0.05)
    assert found.max_position_error == pytest.approx(0, abs=1e-9)
    assert found.max_path_error == pytest.approx(0, abs=0.1)


def test_a_displaced_flight_is_priced_slot_by_slot(solution: Solution) -> None:
    w = solution.w + np.random.default_rng(1).normal(size=solution.w.shape) * 5
    I_U, _ = rates_along(solution, w)
    link = solution.problem.bs_uav
    for n in (0, 7, len(w) - 1):
        d2 = np.sum((w[n] - link.gains.station) ** 2) + link.gains.height**2
        H_r = link.small_scale(w)[..., n, :, :]
        H = np.sqrt(solution.plan.radio.reference_gain / d2) * H_r
        expected = cutoff_rate(H, solution.P_B[..., n, :, :], link.classes, link.noise)
        assert np.mean(expected) == pytest.approx(I_U[n])
    assert np.abs(I_U - solution.I_U).max() > 1e-4


def test_a_late_flight_is_told_and_what_serves_it_better(solution: Solution) -> None:
    t, w = held(solution)
    for late in (-1.5, 0.7, 3.0):
        found = price_flight(solution, t + late, w)
        assert found.duration == pytest.approx(solution.plan.flight.duration + late, abs=1e-3)
    behind = np.vstack([solution.w[:1]] * 5 + [solution.w[:-5]])
    slots = nearest_slots(solution, behind)
    assert np.abs(solution.w[slots] - behind).max() < 1e-9
    by_time = min(each.mean() for each in rates_along(solution, behind))
    by_place = min(each.mean() for each in rates_along(solution, behind, slots))
    if solution.P_B.ndim == 3:  # there is a table
        better = {"time": by_time - by_place, "place": by_place - by_time}
        assert better[taken_by(solution.plan)] > 0


def test_the_table_holds_every_slot(small_plan: MakePlan) -> None:
    solution = optimize(small_plan())
    rows = list(csv.DictReader(io.StringIO(precoder_table(solution))))
    assert len(rows) == len(solution.t)
    frame = solution.plan.origin.frame
    for n, row in enumerate(rows):
        assert row.pop("taken_by") == "place"
        values = {name: float(value) for name, value in row.items()}
        assert values["slot"] == n
        assert values["t_s"] == pytest.approx(solution.t[n])
        assert [values["east_m"], values["north_m"]] == pytest.approx(solution.w[n], abs=1e-8)
        place = frame.to_local(values["latitude_deg"], values["longitude_deg"])
        assert place == pytest.approx(solution.w[n], abs=1e-3)
        for name, P in (("P_B", solution.P_B[n]), ("P_U", solution.P_U[n])):
            for (i, j), entry in np.ndenumerate(P):
                told = (values[f"{name}_{i + 1}_{j + 1}_{part}"] for part in ("re", "im"))
                assert complex(*told) == pytest.approx(entry, rel=1e-10, abs=1e-14)
    with pytest.raises(InputError, match="csi: statistical"):
        precoder_table(optimize(small_plan(FADINGS[3])))
