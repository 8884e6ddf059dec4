"""The link that was planned."""

from dataclasses import replace

import pytest
from conftest import SMALL, edited
from judged import LINK, Given, check, flown

from faao_mav.plan import Radio, parse_plan
from faao_mav.plan.radio_values import doubtful_values
from faao_mav.validate import Stretch


def radio(**changes: float) -> Radio:
    return parse_plan(edited(SMALL, {f"radio.{key}": v for key, v in changes.items()})).radio


def noisy(relay: float, **more: float) -> Given:
    changes = {"relay.noise_dbm": relay} | more
    return Given(flown(), link=replace(LINK, radio=radio(**changes)))


# the rule, what it speaks about, the item that it names, what it lets pass
CASES = [
    (
        "link-nothing",
        Given(flown(), link=replace(LINK, planned_delivered=9e-4, predicted_delivered=9e-4)),
        None,
        Given(flown(), link=replace(LINK, planned_delivered=2e-3, predicted_delivered=2e-3)),
    ),
    (
        "link-elsewhere",
        Given(flown(), link=replace(LINK, path_error=7e6, away=7e6)),
        None,
        Given(flown(), link=replace(LINK, path_error=7e3, away=1e3)),
    ),
    ("radio-values", noisy(91), None, noisy(-91)),
    ("radio-values", noisy(-174), None, noisy(-140)),
    ("radio-values", noisy(-110, bandwidth_mhz=20), None, noisy(-101, bandwidth_mhz=20)),
    (
        "radio-values",
        noisy(-91, **{"base_station.power_dbm": 100}),
        None,
        noisy(-91, **{"base_station.power_dbm": 40}),
    ),
    (
        "link-rate-reduced",
        Given(flown(), link=replace(LINK, predicted_delivered=1.989)),
        None,
        Given(flown(), link=replace(LINK, predicted_delivered=1.991)),
    ),
    (
        "link-rate-reduced",
        Given(flown(), link=replace(LINK, predicted_delivered=0.5, worst=Stretch(30, 41, 0.05))),
        None,
        Given(flown()),
    ),
    (
        "link-path",
        Given(flown(), link=replace(LINK, path_error=2.3)),
        None,
        Given(flown(), link=replace(LINK, path_error=2.1)),
    ),
    (
        "link-late",
        Given(flown(), link=replace(LINK, predicted_duration=126.1)),
        None,
        Given(flown(), link=replace(LINK, predicted_duration=125.9)),
    ),
    (
        "link-late",
        Given(flown(), link=replace(LINK, planned_duration=20, predicted_duration=23.1)),
        None,
        Given(flown(), link=replace(LINK, planned_duration=20, predicted_duration=22.9)),
    ),
    (
        "link-apart",
        Given(flown(), link=replace(LINK, rms_position_error=3.1)),
        None,
        Given(flown(), link=replace(LINK, rms_position_error=2.9)),
    ),
    (
        "link-altitude",
        Given(flown(), link=replace(LINK, altitude_error=2.1)),
        None,
        Given(flown(), link=replace(LINK, altitude_error=1.9)),
    ),
    ("link-timing", Given(flown(), link=LINK), None, Given(flown())),
]


@pytest.mark.parametrize(("rule", "trips", "item", "passes"), CASES)
def test_the_rule_speaks_and_is_silent(
    rule: str, trips: Given, item: int | None, passes: Given
) -> None:
    check(rule, trips, item, passes)


def test_a_doubtful_value_names_the_likely_slip() -> None:
    told = dict(doubtful_values(radio(**{"relay.noise_dbm": 91, "bandwidth_mhz": 20})))
    assert list(told.values()) == ["did you mean -91?"]
    density = dict(doubtful_values(radio(**{"ground_user.noise_dbm": -174, "bandwidth_mhz": 20})))
    assert list(density.values()) == ["if it is a density (dBm/Hz), give -101.0 for the band"]


def test_of_a_plan_of_another_place_nothing_else_is_said() -> None:
    far = replace(LINK, path_error=7e6, away=7e6, rms_position_error=7e6, predicted_delivered=0.0)
    assert [each.rule for each in Given(flown(), link=far).findings()] == ["link-elsewhere"]
