"""The list of rules, and what holds for all of them."""

import re
from importlib import import_module
from itertools import chain

import pytest
from judged import VEHICLES, Given, at, flown, having, mission, raw, speed

from faao_mav.autopilot import Vehicle
from faao_mav.validate import RULES, Finding, Level, validate

MODULES = (
    *("ardupilot", "extent", "fences", "flyability", "items", "link", "px4", "storage", "upload"),
)


def test_every_rule_is_tried_from_both_sides() -> None:
    cases = chain.from_iterable(import_module(f"test_validate_{name}").CASES for name in MODULES)
    assert {case[0] for case in cases} == {rule.id for rule in RULES}


def test_rules_can_be_cited() -> None:
    assert len({rule.id for rule in RULES}) == len(RULES)
    for rule in RULES:
        assert re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", rule.id)
        assert rule.summary
        assert rule.source


def test_rules_of_the_other_autopilot_are_silent() -> None:
    given = flown(speed(20), raw(0, 0, 30), at(0, 9, 0, 2.5, 3, 3, 3))
    for vehicle in VEHICLES:
        other = "px4-" if vehicle.autopilot == "ardupilot" else "ardupilot-"
        assert not [f for f in validate(given, vehicle) if f.rule.startswith(other)]


def test_worst_first_then_by_item() -> None:
    order = [Level.ERROR, Level.WARNING, Level.NOTE]
    found = Given(mission(at(0, 9, 0), at(0, 9, 9, frame=1), speed(0), home=None)).findings()
    levels = [order.index(finding.level) for finding in found]
    assert levels == sorted(levels)
    assert len(set(levels)) == 3
    errors = [finding.item or 0 for finding in found if finding.level is Level.ERROR]
    assert errors == sorted(errors)


def test_a_sound_mission_has_no_findings() -> None:
    sound = flown(speed(8), at(0, 100, 30, 6), at(100, 150, 30), at(200, 160, 30, 10))
    for vehicle in VEHICLES[::2]:
        assert validate(sound, vehicle) == ()


def test_parameters_that_are_no_numbers_count_as_not_given() -> None:
    given = Given(flown(at(0, 9, 9)), having(VEHICLES[2], GF_MAX_HOR_DIST=float("nan")))
    assert given.findings() == Given(flown(at(0, 9, 9)), VEHICLES[2]).findings()


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_a_finding_says_what_to_do(vehicle: Vehicle) -> None:
    given = flown(speed(20), raw(0, 0, 30), at(0, 9, 0, 2.5, 3, 3, 3), at(0, 9, 9, frame=1))
    found: tuple[Finding, ...] = validate(given, vehicle)
    assert found
    for finding in found:
        assert finding.action == finding.action.strip()
        assert not finding.action.endswith(".")
