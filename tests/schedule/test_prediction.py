"""How far a flight is from the plan, what it delivers, and the table a radio goes by."""

import csv
import io
import math
from typing import Any

import numpy as np
import pytest
from conftest import MakePlan
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.pricing import fresh_rates
from faao_mav.optimizer.solution import Solution
from faao_mav.radio.rate import cutoff_rate
from faao_mav.radio.relay import forward_greedily
from faao_mav.report import summary
from faao_mav.schedule.precoder_table import precoder_table, taken_by
from faao_mav.schedule.prediction import (
    deviation,
    lateness,
    nearest_slots,
    price_flight,
    rates_along,
)
from faao_mav.vector import distances_to_path, distances_to_segment
from faao_mav.workflow import Result

HALF = {"radio.causal": True, "radio.duplex": "half"}
KINDS: list[dict[str, Any]] = [
    {"radio.fading": "none"},
    HALF | {"radio.fading": "realization"},
    {"radio.causal": True, "radio.fading_samples": 16},
    HALF | {"radio.fading_samples": 16, "radio.csi": "instantaneous"},
]


@pytest.fixture(scope="module", params=range(len(KINDS)))
def solution(request: pytest.FixtureRequest, small_plan: MakePlan) -> Solution:
    return optimize(small_plan(KINDS[request.param]))


def held(solution: Solution, seconds: float = 30.0) -> tuple[Real, Real]:
    """The plan as a flight that stays at w_F afterwards, finely sampled."""
    t = np.arange(-5.0, solution.t[-1] + seconds, 0.05)
    return t, np.stack([np.interp(t, solution.t, x) for x in solution.w.T], axis=-1)


def test_the_plan_itself_delivers_the_plan_and_fresh_fading_too(solution: Solution) -> None:
    found, duration = price_flight(solution, *held(solution)), solution.plan.flight.duration
    assert pytest.approx(solution.I_U, abs=1e-9) == found.I_U
    assert pytest.approx(solution.I_G, abs=1e-9) == found.I_G
    assert found.delivered_rate == pytest.approx(solution.delivered_rate, abs=1e-9)
    assert found.by_position.R_avg == pytest.approx(solution.rates.R_avg, abs=1e-9)
    assert found.duration == pytest.approx(duration, abs=0.05)
    assert found.max_position_error == pytest.approx(0, abs=1e-9)
    assert found.max_path_error == pytest.approx(0, abs=0.1)
    w = solution.w + np.random.default_rng(1).normal(size=solution.w.shape) * 5
    I_U, _ = rates_along(solution, w)
    link = solution.problem.bs_uav
    for n in (0, 7, len(w) - 1):
        d2 = np.sum((w[n] - link.gains.station) ** 2) + link.gains.height**2
        H_r = link.small_scale(w)[..., n, :, :]
        H = np.sqrt(solution.plan.radio.reference_gain / d2) * H_r
        expected = cutoff_rate(H, solution.P_B[..., n, :, :], link.modulation, link.noise)
        assert np.mean(expected) == pytest.approx(I_U[n])
    assert np.abs(I_U - solution.I_U).max() > 1e-4
    fresh = fresh_rates(solution)
    if solution.plan.radio.fading == "ergodic":
        assert fresh is not None
        assert 0 < fresh.delivered_error < 0.1
        error = 0.1 + 4 * fresh.delivered_error
        assert fresh.delivered == pytest.approx(solution.delivered_rate, abs=error)
        assert fresh.delivered <= fresh.average + 1e-9
        assert f"{fresh.delivered:.4f} +- " in summary(Result(solution, fresh=fresh), verbose=True)


def test_a_late_flight_is_told_and_what_serves_it_better(solution: Solution) -> None:
    t, w = held(solution)
    for late in (-1.5, 0.7, 3.0):
        found = price_flight(solution, t + late, w)
        assert found.duration == pytest.approx(solution.plan.flight.duration + late, abs=1e-3)
        if solution.shares is not None:  # those of the slots in which it is flown
            I_U, I_G = found.I_U, found.I_G
            again = forward_greedily(solution.shares * I_U, (1 - solution.shares) * I_G)
            assert found.relayed.forwarded == pytest.approx(again.forwarded)
            assert found.delivered_rate < solution.delivered_rate
    behind = np.vstack([solution.w[:1]] * 5 + [solution.w[:-5]])
    slots = nearest_slots(solution, behind)
    assert np.abs(solution.w[slots] - behind).max() < 1e-9
    by_time = min(each.mean() for each in rates_along(solution, behind))
    by_place = min(each.mean() for each in rates_along(solution, behind, slots))
    if solution.P_B.ndim == 3:  # there is a table
        better = {"time": by_time - by_place, "place": by_place - by_time}
        assert better[taken_by(solution.plan)] > 0


def test_the_table_holds_every_slot(solution: Solution) -> None:
    if solution.P_B.ndim > 3:
        with pytest.raises(InputError, match="csi: statistical"):
            precoder_table(solution)
        return
    rows = list(csv.DictReader(io.StringIO(precoder_table(solution))))
    assert len(rows) == len(solution.t)
    frame = solution.plan.origin.frame
    for n, row in enumerate(rows):
        assert row.pop("taken_by") == ("place" if solution.shares is None else "time")
        values = {name: float(value) for name, value in row.items()}
        shares = None if solution.shares is None else pytest.approx(solution.shares[n])
        assert values.get("receive_share") == shares
        assert values["slot"] == n
        assert values["t_s"] == pytest.approx(solution.t[n])
        assert [values["east_m"], values["north_m"]] == pytest.approx(solution.w[n], abs=1e-8)
        place = frame.to_local(values["latitude_deg"], values["longitude_deg"])
        assert place == pytest.approx(solution.w[n], abs=1e-3)
        for name, P in (("P_B", solution.P_B[n]), ("P_U", solution.P_U[n])):
            for (i, j), entry in np.ndenumerate(P):
                told = (values[f"{name}_{i + 1}_{j + 1}_{part}"] for part in ("re", "im"))
                assert complex(*told) == pytest.approx(entry, rel=1e-10, abs=1e-14)


COORDINATES = st.floats(-1e4, 1e4)
PATHS = arrays(float, st.tuples(st.integers(1, 20), st.just(2)), elements=COORDINATES)


def test_a_late_flight_is_off_in_time_and_not_in_space() -> None:
    t = np.linspace(0, 10, 101)
    planned = np.column_stack([8 * t, 0 * t])
    longer = np.linspace(0, 12, 121)
    late = np.column_stack([8 * np.clip(longer - 0.5, 0, 10), 0 * longer])
    found = deviation(t, planned, longer, late, 2.0)
    assert found.path == pytest.approx(0, abs=1e-12)
    assert found.max == pytest.approx(4)
    assert 3.8 < found.rms < 4
    assert found.late == pytest.approx(0.5)
    short = np.column_stack([np.minimum(8 * t, 40.0), 0 * t])
    found = deviation(t, planned, t, short, 2.0)
    assert found.max == pytest.approx(40)
    assert math.isfinite(found.late)


def test_the_path_counts_both_ways_and_to_its_end_at_speed() -> None:
    t = np.arange(3.0)
    straight, bent = (np.array([[0.0, 0], [50, far], [100, 0]]) for far in (0, 7))
    assert deviation(t, straight, t, bent, 1.0).path == pytest.approx(7)
    assert deviation(t, bent, t, straight, 1.0).path == pytest.approx(7)
    t, flown = np.arange(0.0, 20.2, 0.2), np.arange(-3.05, 25.0, 0.1)
    for speed in (25.0, 25.5):  # the last sample is 2.5 m before the end, or behind it
        planned, w = (
            np.column_stack([v * times, 0 * times]) for v, times in ((25.0, t), (speed, flown))
        )
        assert deviation(t, planned, flown, w, 2.0).path < 0.1


@given(st.floats(0.3, 30.0))
def test_a_flight_is_not_over_where_it_passes_its_end_on_the_way(slowness: float) -> None:
    """There and back through the end, and round after round: at any speed it is the same way."""
    t = np.linspace(0.0, 240.0, 241)
    there_and_back = np.interp(t, [0, 160, 240], [-500.0, 700.0, 0.0])
    angle = 2 * np.pi * 3 * t / 240
    for w in (
        np.column_stack([there_and_back, 0 * t]),
        50 * np.column_stack([np.cos(angle), np.sin(angle)]),
    ):
        late = lateness(t, w, slowness * t, w, 2.0)
        assert late == pytest.approx((slowness - 1) * 240, rel=0.02, abs=0.5)


@given(PATHS, PATHS)
def test_the_distance_to_a_path_is_the_least_to_a_leg(points: np.ndarray, path: np.ndarray) -> None:
    legs = list(zip(path, [*path[1:], path[-1]], strict=True))
    expected = np.min([distances_to_segment(points, a, b) for a, b in legs], axis=0)
    assert distances_to_path(points, path) == pytest.approx(expected, abs=1e-6)
    assert distances_to_path(np.full((1, 2), np.nan), path) == np.inf


def test_the_way_before_the_plan_begins_does_not_count() -> None:
    t = np.arange(-20.0, 21.0)
    w = np.column_stack([np.where(t < 10, t, 20 - t), 0 * t])  # w_F, at 0, is passed twice
    assert lateness(t[20:], w[20:], t + 0.5, w, 2.0) == 0.5
