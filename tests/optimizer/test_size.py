"""Plans too large are refused before the work."""

from typing import Any

import pytest
from conftest import MakePlan

from faao_mav.errors import PlanError
from faao_mav.optimizer.problem import build_problem


def antennas(base: int, relay: int, user: int) -> dict[str, Any]:
    keys = ("base_station", "relay", "ground_user")
    return {f"radio.{key}.antennas": n for key, n in zip(keys, (base, relay, user), strict=True)}


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"radio.modulation": "qpsk"} | antennas(7, 7, 7), "1.638e+04 vectors of symbols"),
        ({"radio.modulation": "64qam"} | antennas(2, 3, 2), "2.621e+05 vectors of symbols"),
        (antennas(64, 1, 1), "1.845e+19 vectors of symbols"),
        ({"radio.fading": "ergodic"} | antennas(12, 12, 12), "terms in its sums"),
        (
            {"radio.modulation": "16qam", "radio.fading": "realization", "flight.duration": 500}
            | antennas(3, 3, 3),
            "terms in its sums",
        ),
        (
            {"radio.fading": "ergodic", "radio.fading_samples": 10_000, "flight.duration": 2000},
            "numbers in its channels",
        ),
    ],
)
def test_what_is_too_large_is_refused_by_the_cap_it_exceeds(
    small_plan: MakePlan, changes: dict[str, Any], what: str
) -> None:
    with pytest.raises(PlanError, match=r"radio\.modulation: .* antennas .* are accepted") as error:
        build_problem(small_plan(changes))
    assert what in str(error.value)


def test_what_the_caps_allow_is_built(small_plan: MakePlan) -> None:
    build_problem(small_plan({"radio.modulation": "16qam"} | antennas(3, 3, 3)))
    build_problem(small_plan({"radio.modulation": "64qam"}))
