"""Fences: legs and flights, not only points."""

import pytest
from judged import (
    COPTER,
    PX4,
    Given,
    at,
    check,
    circle,
    fence,
    flown,
    having,
    polygon,
    rally,
    square,
    track,
)

OUT_AND_BACK = ((0, 0, 0), (0, 0, 30), (0, 100, 30), (0, 0, 30))
BULGE = ((0, 0, 0), (0, 0, 30), (60, 50, 30), (0, 100, 30), (0, 0, 30))
BOW_TIE = polygon((0, 0), (100, 100), (100, 0), (0, 100))

# the rule, what it speaks about, the item that it names, what it lets pass
CASES = [
    (
        "fence-crosses-itself",
        Given(flown(fence=fence(BOW_TIE))),
        None,
        Given(flown(fence=fence(square(100)))),
    ),
    (
        "fence-home",
        Given(flown(fence=fence(square(100, east=50.1)))),
        None,
        Given(flown(fence=fence(square(100, east=49.9)))),
    ),
    (
        "fence-home",
        Given(flown(fence=fence(circle(0, 9, 9.1)))),
        None,
        Given(flown(fence=fence(circle(0, 9, 8.9)))),
    ),
    (
        "fence-rally",
        Given(flown(fence=fence(square(100)), rally=(rally(0, 50.1),))),
        None,
        Given(flown(fence=fence(square(100)), rally=(rally(0, 49.9),))),
    ),
    (
        "fence-return",
        Given(flown(fence=fence(square(100), breach_return=rally(0, 50.1)))),
        None,
        Given(flown(fence=fence(square(100), breach_return=rally(0, 49.9)))),
    ),
    (
        "fence-leg",
        Given(flown(at(0, 50.1, 30), fence=fence(square(100)))),
        2,
        Given(flown(at(0, 49.9, 30), fence=fence(square(100)))),
    ),
    (
        "fence-leg",
        Given(flown(at(0, 100, 30), fence=fence(circle(20, 50, 20.1)))),
        2,
        Given(flown(at(0, 100, 30), fence=fence(circle(20, 50, 19.9)))),
    ),
    (
        "fence-leg",
        Given(flown(at(90, 0, 30), fence=fence(square(100), square(100, east=80)))),
        1,
        Given(flown(at(90, 0, 30), fence=fence(square(100), square(100, east=80))), PX4),
    ),
    (
        "fence-leg",
        Given(flown(at(90, 0, 30), fence=fence(square(100), square(100, east=80)))),
        1,
        Given(
            flown(at(90, 0, 30), fence=fence(square(100), square(100, east=80))),
            having(COPTER, FENCE_OPTIONS=2),
        ),
    ),
    (
        "fence-circle",
        Given(flown(at(0, 100, 30, 2, 0, 50, command=18), fence=fence(circle(50, 100, 9)))),
        2,
        Given(flown(at(0, 100, 30, 2, 0, 50, command=18), fence=fence(circle(0, 100, 40)))),
    ),
    (
        "fence-flight",
        Given(
            flown(at(0, 100, 30), fence=fence(circle(40, 50, 30))),
            track=track(BULGE, [0, 1, 1, 2], 5),
        ),
        2,
        Given(
            flown(at(0, 100, 30), fence=fence(circle(60, 50, 20))),
            track=track(OUT_AND_BACK, [0, 1, 2], 5),
        ),
    ),
    (
        "fence-close",
        Given(flown(at(0, 48.1, 30), fence=fence(square(100)))),
        2,
        Given(flown(at(0, 47.9, 30), fence=fence(square(100)))),
    ),
    (
        "fence-margin",
        Given(flown(at(0, 40, 30), fence=fence(square(100)))),
        2,
        Given(flown(at(0, 60, 30), fence=fence(square(100)))),
    ),
    (
        "fence-not-kept",
        Given(flown(fence=fence(square(100)))),
        None,
        Given(flown(fence=fence(square(100))), having(COPTER, FENCE_ENABLE=1)),
    ),
    (
        "fence-not-kept",
        Given(flown(fence=fence(square(100))), having(COPTER, FENCE_ENABLE=1, FENCE_TYPE=3)),
        None,
        Given(flown(), COPTER),
    ),
    (
        "fence-not-kept",
        Given(flown(fence=fence(square(100))), having(PX4, GF_ACTION=1)),
        None,
        Given(flown(fence=fence(square(100))), PX4),
    ),
    (
        "ardupilot-fence-margin",
        Given(flown(at(0, 48.1, 30), fence=fence(square(100)))),
        2,
        Given(flown(at(0, 48.1, 30), fence=fence(square(100))), having(COPTER, FENCE_MARGIN=1.8)),
    ),
    (
        "fence-ahead",
        Given(
            flown(at(0, 100, 30), fence=fence(square(240))),
            having(PX4, GF_PREDICT=1),
            track(OUT_AND_BACK, [0, 1, 2], 5),
        ),
        2,
        Given(
            flown(at(0, 100, 30), fence=fence(square(260))),
            having(PX4, GF_PREDICT=1),
            track(OUT_AND_BACK, [0, 1, 2], 5),
        ),
    ),
]


@pytest.mark.parametrize(("rule", "trips", "item", "passes"), CASES)
def test_the_rule_speaks_and_is_silent(
    rule: str, trips: Given, item: int | None, passes: Given
) -> None:
    check(rule, trips, item, passes)


def test_of_px4_it_is_told_that_it_flies_all_the_same() -> None:
    (finding,) = Given(flown(fence=fence(square(100, east=50.1))), PX4).by("fence-home")
    assert "PX4 says so (Geofence invalid), and flies the mission all the same" in finding.message
