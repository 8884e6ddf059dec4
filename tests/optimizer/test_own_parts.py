"""Parts of one's own in place of the plan's: as the plan's own where they are the same."""

from dataclasses import dataclass

import numpy as np
import pytest
from conftest import MISSIONS

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import OwnParts
from faao_mav.plan import Plan, parse_plan
from faao_mav.radio.gain import GainFunction, PathGain
from faao_mav.radio.precoder import SCHEMES
from faao_mav.radio.rate_steps import StreamRate
from faao_mav.workflow import plan_mission


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


def plan(**changes: object) -> Plan:
    text = (MISSIONS / "copter_relay.yaml").read_text()
    return parse_plan(text).changed({"flight.time_step": 1.0, "flight.duration": 80, **changes})


LAW = {"exponent": 2.2, "elevation_db": [8.0, -12.0]}


def test_a_law_of_ones_own_is_as_the_plans() -> None:
    named = plan(**{"radio.gain": LAW})
    wanted = optimize(named)
    found = optimize(plan(), gain=Same(named.radio.path_gains[0]))
    assert found.delivered_rate == pytest.approx(wanted.delivered_rate, rel=1e-5)
    assert found.is_feasible(1e-6)


def test_slopes_and_turns_by_differences() -> None:
    law, height = PathGain(1e-5, 2.4, (5.0, -30.0, 12.0)), 30.0
    away = np.random.default_rng(0).uniform(-300, 300, (2, 40))
    squared = np.sum(away**2, axis=0) + height**2
    for told, exact in zip(
        Same(law).slopes(away, squared, height), law.slopes(away, squared, height), strict=True
    ):
        np.testing.assert_allclose(told, exact, rtol=1e-4, atol=1e-4 * np.abs(exact).max())
    told, exact = Same(law).turns(900.0, height), law.turns(900.0, height)
    np.testing.assert_allclose(told, exact, atol=900.0 / 499)


def test_a_precoder_of_ones_own_is_as_the_scheme() -> None:
    wanted = optimize(plan(**{"optimizer.precoder": "mrt"}))
    found = optimize(plan(), precoder=SCHEMES["mrt"])
    assert found.delivered_rate == pytest.approx(wanted.delivered_rate, rel=1e-5)


@pytest.mark.usefixtures("coarse_map")
def test_a_rate_of_ones_own_is_planned_priced_and_bounded() -> None:
    quiet = plan(**{"radio.fading": "none"})
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


@pytest.mark.parametrize(
    "changes",
    [
        {"goal": {"rate": 1.0, "minimise": "duration"}},
        {
            "optimizer.method": "algorithm1",
            "radio.fading": "none",
            "radio.causal": False,
            "flight.start_velocity": "free",
        },
    ],
)
def test_parts_are_refused_where_they_would_be_lost(changes: dict[str, object]) -> None:
    parts: OwnParts = {"rate": Shannon()}
    with pytest.raises(InputError, match="rate: "):
        optimize(plan(**changes), **parts)
