"""Rates as functions of the position: derivatives, and tables against exact values."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import MakePlan

from faao_mav.arrays import Real
from faao_mav.optimizer.design import Design, Link, design
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.rates import RateModel, by_position, link_coordinates
from faao_mav.optimizer.rates.field import SlotRate, rate_models
from faao_mav.optimizer.rates.table_rate import TableRate

FARTHEST = 400.0


def gradient_by_differences(f: Callable[[Real], Real], w: Real, h: float = 0.02) -> Real:
    return np.stack([(f(w + h * e) - f(w - h * e)) / (2 * h) for e in np.eye(2)], axis=1)


def hessian_by_differences(f: Callable[[Real], Real], w: Real) -> Real:
    return gradient_by_differences(lambda at: gradient_by_differences(f, at), w, 0.05)


def places(link: Link, seed: int = 3) -> Real:
    rng = np.random.default_rng(seed)
    return link.gains.station + rng.uniform(-150, 150, (20, 2))


def derivatives(link: Link, rate: RateModel, w: Real) -> tuple[Real, Real]:
    gradient, hessian = by_position(link, w.T, rate.partials(*link_coordinates(link, w.T)))
    return gradient.T, hessian[[0, 1, 1, 2]].T.reshape(-1, 2, 2)


def value_of(link: Link, rate: RateModel) -> Callable[[Real], Real]:
    return lambda w: rate.value(*link_coordinates(link, w.T))


def exactly(link: Link, wanted: Design, w: Real) -> Real:
    H = link.channel(w)
    return wanted.rate(link, H, wanted.precoders(link, H))


def differs(link: Link, rate: RateModel, w: Real, *, curvature: float = 1e-2) -> None:
    """Assert that slopes and curvatures at w (n, 2) are those of differences."""
    value = value_of(link, rate)
    gradient, hessian = derivatives(link, rate, w)
    assert gradient == pytest.approx(gradient_by_differences(value, w), rel=1e-3, abs=1e-5)
    assert hessian == pytest.approx(hessian_by_differences(value, w), rel=curvature, abs=1e-4)


def test_the_envelope_theorem(small_plan: MakePlan) -> None:
    """At the best precoders: the exact slope, and a curvature that is never too high."""
    plan = small_plan({"radio.fading": "realization"})
    link = build_problem(plan).bs_uav
    w, rate = places(link), SlotRate(link, design(plan))
    best = value_of(link, rate)
    gradient, hessian = derivatives(link, rate, w)
    assert gradient == pytest.approx(gradient_by_differences(best, w), rel=1e-4, abs=1e-7)
    excess = hessian - hessian_by_differences(best, w)
    assert np.linalg.eigvalsh(excess).max() < 1e-5


STEPS = {"snr_db": [2, 6, 11, 15], "bit_per_s_per_hz": [0.5, 1, 2, 3.5]}
KINDS: dict[str, dict[str, Any]] = {
    "best": {},
    "zf": {"optimizer.precoder": "zf"},
    "gaussian": {"optimizer.inputs": "gaussian", "radio.line_of_sight": "all_ones"},
    "mrt, gaussian": {"optimizer.precoder": "mrt", "optimizer.inputs": "gaussian"},
    "another law": {
        "radio.gain": {"exponent": 2.6, "elevation_db": [20, -60, 20]},
        "radio.ground_user.gain": {"exponent": 2.2},
    },
    "steps": {"radio.rates": STEPS},
    "three antennas": {"radio.rates": STEPS, "radio.relay.antennas": 3},
}
FADINGS: dict[str, dict[str, Any]] = {
    "none": {"radio.fading": "none"},
    "known": {"radio.fading": "realization"},
    "statistical": {"radio.fading_samples": 4},
    "instantaneous": {"radio.fading_samples": 4, "radio.csi": "instantaneous"},
}


@pytest.mark.parametrize(
    ("kind", "fading"),
    [
        *(("best", fading) for fading in FADINGS),
        *(("zf", fading) for fading in ("known", "statistical")),
        ("gaussian", "instantaneous"),
        ("mrt, gaussian", "statistical"),
        ("another law", "known"),
        *(("steps", fading) for fading in ("none", "statistical")),
        ("three antennas", "known"),
    ],
)
def test_models_have_the_rate_of_every_place_and_its_slopes(
    small_plan: MakePlan, kind: str, fading: str
) -> None:
    plan = small_plan(KINDS[kind] | FADINGS[fading])
    wanted = design(plan)
    for link in build_problem(plan).links:
        within = 2e-4
        if link.steps is not None:
            link, within = replace(link, steps=link.steps.widened(3.0)), 1e-3
        rate, w = rate_models([link], wanted, [FARTHEST])[0], places(link)
        exact = exactly(link, wanted, w)
        assert value_of(link, rate)(w) == pytest.approx(exact, abs=within)
        if wanted.optimal and link.steps is None:
            P = rate.initial_precoders(*link_coordinates(link, w.T))
            assert P is not None
            P *= np.sqrt(link.power) / np.linalg.norm(P, axis=(-2, -1), keepdims=True)
            assert link.mean_rates(link.channel(w), P) == pytest.approx(exact, abs=2e-3)
        differs(link, rate, w, curvature=1e-2 if link.steps is None else 2e-2)


def test_tables_of_mutual_information(small_plan: MakePlan) -> None:
    """The curves are smooth, and nowhere above what precoders of the place itself carry."""
    for_it = {"optimizer.rate": "mutual_information", "radio.line_of_sight": "all_ones"}
    plan = small_plan(for_it | {"radio.fading_samples": 2})
    wanted, link = design(plan), build_problem(plan).bs_uav
    rate, w = rate_models([link], wanted, [FARTHEST])[0], places(link)
    assert isinstance(rate, TableRate)
    at = link_coordinates(link, w.T)
    H = link.channel(w)
    P = rate.initial_precoders(*at)
    assert rate.value(*at) == pytest.approx(wanted.rate(link, H, P), abs=3e-3)
    differs(link, rate, w)
