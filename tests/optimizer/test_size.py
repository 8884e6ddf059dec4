"""Plans too large are refused before the work, with sizes that would do."""

import re
from typing import Any

import pytest
from conftest import MakePlan

from faao_mav.errors import PlanError
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.size import cost


def antennas(base: int, relay: int, user: int) -> dict[str, Any]:
    keys = ("base_station", "relay", "ground_user")
    return {f"radio.{key}.antennas": n for key, n in zip(keys, (base, relay, user), strict=True)}


TOO_LARGE: list[dict[str, Any]] = [
    {"radio.modulation": "bpsk"} | antennas(12, 12, 12),
    {"radio.modulation": "qpsk", "radio.fading": "ergodic"} | antennas(7, 7, 7),
    {"radio.modulation": "64qam"} | antennas(2, 3, 2),
    {"radio.modulation": "16qam", "radio.fading": "realization", "flight.duration": 500}
    | antennas(3, 3, 3),
    {"radio.modulation": "64qam", "optimizer.rate": "mutual_information", "flight.duration": 500},
    {"radio.fading": "ergodic", "radio.fading_samples": 10_000, "flight.duration": 1000},
    {"radio.fading": "none", "optimizer.precoder": "mrt"} | antennas(64, 1, 1),
]


@pytest.mark.parametrize("changes", TOO_LARGE)
def test_what_is_too_large_is_refused_and_what_is_proposed_is_not(
    small_plan: MakePlan, changes: dict[str, Any]
) -> None:
    with pytest.raises(PlanError, match=r"radio\.modulation: .* antennas .* are accepted") as error:
        build_problem(small_plan(changes))
    text = str(error.value)
    proposals = [{k: scalar(v)} for k, v in re.findall(r"(\w+\.\w+): ([\w.]+)(?= or| would)", text)]
    if most := re.search(r"at most (\d+) antennas", text):
        given = {key: n for key, n in (antennas(2, 2, 2) | changes).items() if "antennas" in key}
        proposals.append({key: min(int(most[1]), n) for key, n in given.items()})
    assert proposals
    for proposal in proposals:
        build_problem(small_plan(changes | proposal))


def scalar(text: str) -> str | float:
    try:
        return int(text) if text.isdigit() else float(text)
    except ValueError:
        return text


@pytest.mark.parametrize(
    "changes",
    [
        antennas(3, 2, 2),
        antennas(2, 3, 2),
        {"radio.modulation": "8psk"},
        {"radio.fading_samples": 64},
        {"flight.duration": 500},
    ],
)
def test_more_of_anything_costs_more(small_plan: MakePlan, changes: dict[str, Any]) -> None:
    base = {"radio.modulation": "qpsk", "radio.fading": "ergodic"}
    (seconds, gigabytes), (more, larger) = (
        cost(small_plan(base | extra)) for extra in ({}, changes)
    )
    assert more > seconds
    assert larger > gigabytes


def test_a_goal_costs_several_optimisations(small_plan: MakePlan) -> None:
    large = antennas(9, 9, 9) | {"radio.causal": True, "optimizer.method": "direct"}
    build_problem(small_plan(large))
    with pytest.raises(PlanError, match=r"takes about 30 minutes .* at most 7 antennas or radio"):
        build_problem(small_plan(large | {"goal": {"rate": 0.1, "minimise": "duration"}}))
