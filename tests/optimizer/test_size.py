"""Plans too large are refused before the work."""

from typing import Any

import pytest
from conftest import MakePlan

from faao_mav.errors import PlanError
from faao_mav.optimizer.problem import build_problem


def antennas(base: int, relay: int, user: int) -> dict[str, Any]:
    keys = ("base_station", "relay", "ground_user")
    return {f"radio.{key}.antennas": n for key, n in zip(keys, (base, relay, user), strict=True)}


def test_what_is_too_large_is_refused_by_the_cap_it_exceeds(small_plan: MakePlan) -> None:
    ergodic = {"radio.fading": "ergodic"}
    for changes, what in (
        ({"radio.modulation": "qpsk"} | antennas(7, 7, 7), "1.638e+04 vectors of symbols"),
        (antennas(64, 1, 1), "1.845e+19 vectors of symbols"),
        (ergodic | antennas(12, 12, 12), "terms in its sums"),
        (ergodic | {"radio.fading_samples": 10_000, "flight.duration": 2000}, "in its channels"),
    ):
        with pytest.raises(PlanError, match=r"modulation: .* antennas .* are accepted") as error:
            build_problem(small_plan(changes))
        assert what in str(error.value)
    build_problem(small_plan({"radio.modulation": "16qam"} | antennas(3, 3, 3)))
    build_problem(small_plan({"radio.modulation": "64qam"}))
