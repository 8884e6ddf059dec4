"""The rate along a flight that is not quite the planned one, and the table a radio goes by."""

import csv
import io
from typing import Any

import numpy as np
import pytest
from conftest import MakePlan

from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.solution import Solution
from faao_mav.radio.rate import cutoff_rate
from faao_mav.schedule.precoder_table import precoder_table, taken_by
from faao_mav.schedule.prediction import nearest_slots, rates_along

FADINGS: list[dict[str, Any]] = [
    {"radio.fading": "none"},
    {"radio.fading": "realization"},
    {"radio.fading": "ergodic", "radio.fading_samples": 4},
    {"radio.fading": "ergodic", "radio.fading_samples": 4, "radio.csi": "instantaneous"},
]


@pytest.fixture(scope="module", params=range(len(FADINGS)))
def solution(request: pytest.FixtureRequest, small_plan: MakePlan) -> Solution:
    return optimize(small_plan(FADINGS[request.param]))


def test_the_planned_flight_delivers_the_planned_rate(solution: Solution) -> None:
    I_U, I_G = rates_along(solution, solution.w)
    assert pytest.approx(solution.I_U, abs=1e-12) == I_U
    assert pytest.approx(solution.I_G, abs=1e-12) == I_G


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


def test_by_position_an_aircraft_that_is_late_still_has_the_right_precoders(
    solution: Solution,
) -> None:
    late = np.vstack([solution.w[:1]] * 3 + [solution.w[:-3]])
    slots = nearest_slots(solution, late)
    assert np.abs(solution.w[slots] - late).max() < 1e-9
    assert np.isfinite(rates_along(solution, late, slots)[0]).all()


def test_the_table_holds_every_slot(small_plan: MakePlan) -> None:
    solution = optimize(small_plan())
    rows = list(csv.DictReader(io.StringIO(precoder_table(solution))))
    assert len(rows) == len(solution.t)
    frame = LocalFrame(solution.plan.origin.latitude, solution.plan.origin.longitude)
    for n, row in enumerate(rows):
        assert row.pop("taken_by") == "place"
        values = {name: float(value) for name, value in row.items()}
        assert values["slot"] == n
        assert values["t_s"] == pytest.approx(solution.t[n])
        assert [values["east_m"], values["north_m"]] == pytest.approx(solution.w[n], abs=1e-8)
        place = frame.to_local(values["latitude_deg"], values["longitude_deg"])
        assert place == pytest.approx(solution.w[n], abs=1e-3)
        for name, P in (("P_B", solution.P_B[n]), ("P_U", solution.P_U[n])):
            found = [
                [
                    complex(values[f"{name}_{i}_{j}_re"], values[f"{name}_{i}_{j}_im"])
                    for j in (1, 2)
                ]
                for i in (1, 2)
            ]
            assert np.allclose(found, P, rtol=1e-10, atol=1e-14)


def test_a_late_aircraft_is_told_to_take_the_precoders_that_serve_it_better(
    solution: Solution,
) -> None:
    late = np.vstack([solution.w[:1]] * 5 + [solution.w[:-5]])
    by_time = min(each.mean() for each in rates_along(solution, late))
    by_place = min(
        each.mean() for each in rates_along(solution, late, nearest_slots(solution, late))
    )
    if solution.P_B.ndim == 3:  # there is a table
        better = {"time": by_time - by_place, "place": by_place - by_time}
        assert better[taken_by(solution.plan)] > 0


def test_precoders_that_know_the_draw_have_no_table(small_plan: MakePlan) -> None:
    with pytest.raises(InputError, match="csi: statistical"):
        precoder_table(optimize(small_plan(FADINGS[3])))
