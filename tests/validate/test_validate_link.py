"""The link that was planned."""

from dataclasses import replace

import pytest
from judged import LINK, Given, check, flown

from faao_mav.validate import Stretch

# the rule, what it speaks about, the item that it names, what it lets pass
CASES = [
    (
        "link-rate-lost",
        Given(flown(), link=replace(LINK, predicted_delivered=1.899)),
        None,
        Given(flown(), link=replace(LINK, predicted_delivered=1.901)),
    ),
    (
        "link-rate-reduced",
        Given(flown(), link=replace(LINK, predicted_delivered=1.989)),
        None,
        Given(flown(), link=replace(LINK, predicted_delivered=1.991)),
    ),
    (
        "link-rate-reduced",
        Given(flown(), link=replace(LINK, predicted_delivered=1.901, worst=Stretch(30, 41, 0.05))),
        None,
        Given(flown(), link=replace(LINK, predicted_delivered=1.899)),
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
