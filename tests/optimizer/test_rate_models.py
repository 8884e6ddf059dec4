"""Rates as functions of the position: derivatives, and tables against exact values."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import MakePlan

from faao_mav.arrays import Real
from faao_mav.optimizer.design import Design, design
from faao_mav.optimizer.problem import Link, build_problem
from faao_mav.optimizer.rates import RateModel, by_position, link_coordinates
from faao_mav.optimizer.rates.field import rate_models
from faao_mav.optimizer.rates.slot_rate import SlotRate
from faao_mav.optimizer.rates.table_rate import TableRate

FARTHEST = 400.0


def gradient_by_differences(f: Callable[[Real], Real], w: Real, h: float = 0.02) -> Real:
    return np.stack([(f(w + h * e) - f(w - h * e)) / (2 * h) for e in np.eye(2)], axis=1)


def hessian_by_differences(f: Callable[[Real], Real], w: Real, h: float = 0.05) -> Real:
    def slope(along: Real) -> Real:
        return gradient_by_differences(f, w + along)

    return np.stack([(slope(h * e) - slope(-h * e)) / (2 * h) for e in np.eye(2)], axis=1)


def places(link: Link, seed: int = 3) -> Real:
    rng = np.random.default_rng(seed)
    return link.gains.station + rng.uniform(-150, 150, (20, 2))


def coordinates(link: Link, w: Real) -> tuple[Real, Real]:
    return link_coordinates(link, w.T)


def derivatives(link: Link, rate: RateModel, w: Real) -> tuple[Real, Real]:
    gradient, hessian = by_position(link, w.T, rate.partials(*coordinates(link, w)))
    return gradient.T, hessian[[0, 1, 1, 2]].T.reshape(-1, 2, 2)


@pytest.mark.parametrize("line_of_sight", ["ula", "all_ones"])
@pytest.mark.parametrize("hop", [0, 1])
def test_the_envelope_theorem(small_plan: MakePlan, line_of_sight: str, hop: int) -> None:
    """At the best precoders: the exact slope, and a curvature that is never too high."""
    plan = small_plan({"radio.line_of_sight": line_of_sight, "radio.fading": "realization"})
    link = build_problem(plan).links[hop]
    w, rate = places(link), SlotRate(link, design(plan))

    def best(at: Real) -> Real:
        return rate.value(*coordinates(link, at))

    gradient, hessian = derivatives(link, rate, w)
    assert gradient == pytest.approx(gradient_by_differences(best, w), rel=1e-4, abs=1e-7)
    excess = hessian - hessian_by_differences(best, w)
    assert np.linalg.eigvalsh(excess).max() < 1e-5


def test_rates_by_differences(small_plan: MakePlan) -> None:
    plan = small_plan({"radio.fading": "realization", "optimizer.precoder": "mmse"})
    link = build_problem(plan).bs_uav
    w, rate = places(link), SlotRate(link, design(plan))
    gradient, hessian = derivatives(link, rate, w)

    def at(moved: Real) -> Real:
        return rate.value(*coordinates(link, moved))

    assert at(w) == pytest.approx(exactly(link, design(plan), w))
    assert gradient == pytest.approx(gradient_by_differences(at, w), rel=1e-3, abs=1e-5)
    assert hessian == pytest.approx(hessian_by_differences(at, w), rel=1e-2, abs=1e-4)


@pytest.mark.parametrize(
    ("fading", "precoder"), [("ergodic", "faao"), ("realization", "faao"), ("none", "mmse")]
)
def test_another_law_of_the_gain(small_plan: MakePlan, fading: str, precoder: str) -> None:
    """Tables cover gains that do not fall with the distance, and slopes are the law's."""
    law = {"exponent": 2.6, "elevation_db": [20, -60, 20]}
    changes = {"radio.fading": fading, "optimizer.precoder": precoder, "radio.fading_samples": 4}
    plan = small_plan(changes | {"radio.gain": law, "radio.ground_user.gain": {"exponent": 2.2}})
    wanted, problem = design(plan), build_problem(plan)
    assert [law.exponent for law in plan.radio.path_gains] == [2.6, 2.2]
    for link in problem.links:
        rate, w = rate_models([link], wanted, [FARTHEST])[0], places(link)

        def value(at: Real, rate: RateModel = rate, link: Link = link) -> Real:
            return rate.value(*coordinates(link, at))

        assert value(w) == pytest.approx(exactly(link, wanted, w), abs=2e-4)
        gradient, hessian = derivatives(link, rate, w)
        assert gradient == pytest.approx(gradient_by_differences(value, w), rel=1e-3, abs=1e-6)
        assert hessian == pytest.approx(hessian_by_differences(value, w), rel=1e-2, abs=1e-4)


@pytest.mark.parametrize(
    ("fading", "csi", "antennas"),
    [
        ("none", "statistical", 2),
        ("realization", "statistical", 3),
        ("ergodic", "statistical", 2),
        ("ergodic", "instantaneous", 2),
    ],
)
def test_steps_of_a_radio_that_rise_are_one_table(
    small_plan: MakePlan, fading: str, csi: str, antennas: int
) -> None:
    names = ("base_station", "relay")
    changes: dict[str, Any] = {f"radio.{name}.antennas": antennas for name in names}
    steps = {"snr_db": [2, 6, 11, 15], "bit_per_s_per_hz": [0.5, 1, 2, 3.5]}
    changes |= {"radio.fading": fading, "radio.csi": csi, "radio.fading_samples": 4}
    plan = small_plan(changes | {"radio.rates": steps})
    wanted = design(plan)
    link = build_problem(plan).bs_uav
    assert link.steps is not None
    link = replace(link, steps=link.steps.widened(3.0))
    rate, w = rate_models([link], wanted, [FARTHEST])[0], places(link)

    def value(at: Real) -> Real:
        return rate.value(*coordinates(link, at))

    assert value(w) == pytest.approx(exactly(link, wanted, w), abs=1e-3)
    gradient, hessian = derivatives(link, rate, w)
    assert gradient == pytest.approx(gradient_by_differences(value, w), rel=1e-3, abs=1e-6)
    assert hessian == pytest.approx(hessian_by_differences(value, w), rel=2e-2, abs=1e-4)


def exactly(link: Link, wanted: Design, w: Real) -> Real:
    H = link.channel(w)
    return wanted.rate(link, H, wanted.precoders(link, H))


@pytest.mark.parametrize(
    ("precoder", "inputs", "line_of_sight"),
    [
        ("faao", "alphabet", "ula"),
        ("faao", "alphabet", "all_ones"),
        ("zf", "alphabet", "ula"),
        ("faao", "gaussian", "all_ones"),
        ("mrt", "gaussian", "ula"),
    ],
)
@pytest.mark.parametrize(
    ("fading", "csi"),
    [("none", "statistical"), ("ergodic", "statistical"), ("ergodic", "instantaneous")],
)
def test_tables_hold_the_rate_at_every_place(
    small_plan: MakePlan, line_of_sight: str, fading: str, csi: str, precoder: str, inputs: str
) -> None:
    plan = small_plan(
        {
            "radio.line_of_sight": line_of_sight,
            "radio.fading": fading,
            "radio.csi": csi,
            "radio.fading_samples": 4,
            "optimizer.precoder": precoder,
            "optimizer.inputs": inputs,
        }
    )
    wanted = design(plan)
    for link in build_problem(plan).links:
        rate, w = rate_models([link], wanted, [FARTHEST])[0], places(link)
        tabled, exact = rate.value(*coordinates(link, w)), exactly(link, wanted, w)
        assert tabled == pytest.approx(exact, abs=2e-4)
        if wanted.optimal:
            P = rate.initial_precoders(*coordinates(link, w))
            assert P is not None
            P *= np.sqrt(link.power) / np.linalg.norm(P, axis=(-2, -1), keepdims=True)
            assert link.mean_rates(link.channel(w), P) == pytest.approx(exact, abs=2e-3)

        def value(at: Real, rate: RateModel = rate, link: Link = link) -> Real:
            return rate.value(*coordinates(link, at))

        gradient, hessian = derivatives(link, rate, w)
        assert gradient == pytest.approx(gradient_by_differences(value, w), rel=1e-3, abs=1e-6)
        assert hessian == pytest.approx(hessian_by_differences(value, w), rel=1e-2, abs=1e-4)


@pytest.mark.parametrize(("fading", "precoder"), [("ergodic", "faao"), ("none", "zf")])
def test_tables_of_mutual_information(small_plan: MakePlan, fading: str, precoder: str) -> None:
    """The curves are smooth, and nowhere above what precoders of the place itself carry."""
    plan = small_plan(
        {
            "optimizer.rate": "mutual_information",
            "optimizer.precoder": precoder,
            "radio.fading": fading,
            "radio.fading_samples": 4,
            "radio.modulation": "qpsk",
            "radio.line_of_sight": "all_ones",
        }
    )
    wanted, link = design(plan), build_problem(plan).bs_uav
    rate, w = rate_models([link], wanted, [FARTHEST])[0], places(link)
    assert isinstance(rate, TableRate)
    at = coordinates(link, w)
    H = link.channel(w)
    P = rate.initial_precoders(*at) if wanted.optimal else wanted.precoders(link, H)
    assert rate.value(*at) == pytest.approx(wanted.rate(link, H, P), abs=3e-3)
    gradient, hessian = derivatives(link, rate, w)

    def value(moved: Real) -> Real:
        return rate.value(*coordinates(link, moved))

    assert gradient == pytest.approx(gradient_by_differences(value, w), rel=1e-3, abs=1e-6)
    assert hessian == pytest.approx(hessian_by_differences(value, w), rel=1e-2, abs=1e-4)


def test_the_best_rate_falls_with_the_distance_and_not_with_the_direction(
    small_plan: MakePlan,
) -> None:
    plan = small_plan({"radio.fading": "ergodic", "radio.fading_samples": 8})
    link, wanted = build_problem(plan).uav_user, design(plan)
    angle = np.linspace(0, 2 * np.pi, 9)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    rings = [exactly(link, wanted, link.gains.station + r * circle) for r in (20, 60, 120)]
    for ring in rings:
        assert np.ptp(ring) < 1e-5
    assert rings[0].min() > rings[1].max() > rings[1].min() > rings[2].max()
