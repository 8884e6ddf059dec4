"""What storage loses."""

import math

import pytest
from judged import PLANE, PX4, Given, at, check, flown

NAN = math.nan

# the rule, what it speaks about, the item that it names, what it lets pass
CASES = [
    ("hold-changed", Given(flown(at(0, 9, 9, 2.7))), 2, Given(flown(at(0, 9, 9, 2.0)))),
    ("hold-changed", Given(flown(at(0, 9, 9, 65_536))), 2, Given(flown(at(0, 9, 9, 65_535)))),
    ("hold-changed", Given(flown(at(0, 9, 9, -1))), 2, Given(flown(at(0, 9, 9, 0)))),
    (
        "hold-changed",
        Given(flown(at(0, 9, 9, 5)), PLANE),
        2,
        Given(flown(at(0, 9, 9, 5, command=19)), PLANE),
    ),
    ("hold-changed", Given(flown(at(0, 9, 9, 2.7))), 2, Given(flown(at(0, 9, 9, 2.7)), PX4)),
    ("value-dropped", Given(flown(at(0, 9, 9, 0, 5))), 2, Given(flown(at(0, 9, 9, 0, 5)), PX4)),
    (
        "value-dropped",
        Given(flown(at(0, 9, 9, 0, 0, 0, 90))),
        2,
        Given(flown(at(0, 9, 9, 0, 0, 0, NAN))),
    ),
    (
        "value-dropped",
        Given(flown(at(0, 9, 9, 0, 0, 3)), PX4),
        2,
        Given(flown(at(0, 9, 9, 0, 3, 0, -90)), PX4),
    ),
    (
        "value-dropped",
        Given(flown(at(0, 9, 9, 0, 256)), PLANE),
        2,
        Given(flown(at(0, 9, 9, 0, 255)), PLANE),
    ),
    ("altitude-rounded", Given(flown(at(0, 9, 30.126))), 2, Given(flown(at(0, 9, 30.12)))),
]


@pytest.mark.parametrize(("rule", "trips", "item", "passes"), CASES)
def test_the_rule_speaks_and_is_silent(
    rule: str, trips: Given, item: int | None, passes: Given
) -> None:
    check(rule, trips, item, passes)
