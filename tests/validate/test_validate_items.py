"""Items and their order."""

import math

import pytest
from judged import (
    COPTER,
    LAND,
    PX4,
    RTL,
    TAKEOFF,
    Given,
    at,
    check,
    do,
    fence,
    flown,
    having,
    mission,
    rally,
    speed,
)

from faao_mav.mission.command import Command
from faao_mav.mission.item import Home

NAN = math.nan
JUMP, START = Command.DO_JUMP, Command.DO_LAND_START
CONTINUES = having(COPTER, MIS_OPTIONS=4)

# the rule, what it speaks about, the item that it names, what it lets pass
CASES = [
    ("empty", Given(mission()), None, Given(mission(TAKEOFF))),
    ("no-home", Given(mission(TAKEOFF, home=None)), None, Given(mission(TAKEOFF))),
    (
        "home-height",
        Given(mission(TAKEOFF, home=Home(47.0, 8.0, NAN))),
        None,
        Given(mission(TAKEOFF, home=Home(31.5, 35.5, -420.0))),
    ),
    (
        "home-height",
        Given(mission(TAKEOFF, home=Home(47.0, 8.0, 29_064.96))),
        None,
        Given(mission(TAKEOFF, home=Home(28.0, 86.9, 8_800.0))),
    ),
    (
        "rally-height",
        Given(mission(TAKEOFF, rally=(rally(9, 9, NAN),))),
        None,
        Given(mission(TAKEOFF, rally=(rally(9, 9, 30),))),
    ),
    (
        "rally-height",
        Given(mission(TAKEOFF, fence=fence(breach_return=rally(9, 9, NAN)))),
        None,
        Given(mission(TAKEOFF, fence=fence(breach_return=rally(9, 9, 30)))),
    ),
    ("unreachable", Given(flown(at(0, 9, 9), RTL, at(0, 9, 9))), 4, Given(flown(at(0, 9, 9)))),
    (
        "unreachable",
        Given(mission(TAKEOFF, LAND, RTL)),
        3,
        Given(mission(TAKEOFF, LAND, RTL), PX4),
    ),
    (
        "unreachable",
        Given(mission(TAKEOFF, LAND, TAKEOFF, RTL)),
        3,
        Given(mission(TAKEOFF, LAND, TAKEOFF, RTL), CONTINUES),
    ),
    (
        "unreachable",
        Given(mission(TAKEOFF, LAND, at(0, 9, 9), RTL), CONTINUES),
        3,
        Given(mission(TAKEOFF, LAND, speed(5), TAKEOFF, RTL), CONTINUES),
    ),
    ("unreachable", Given(flown(RTL), PX4), 3, Given(mission(TAKEOFF, LAND, RTL), PX4)),
    (
        "flies-on",
        Given(mission(TAKEOFF, LAND, at(0, 9, 9)), PX4),
        2,
        Given(mission(TAKEOFF, LAND, at(0, 9, 9))),
    ),
    (
        "flies-on",
        Given(mission(TAKEOFF, LAND, TAKEOFF, RTL), CONTINUES),
        2,
        Given(mission(TAKEOFF, RTL, LAND, at(0, 9, 9)), PX4),
    ),
    (
        "unreachable",
        Given(flown(at(0, 9, 9, command=17))),
        3,
        Given(mission(TAKEOFF, RTL, do(START), LAND)),
    ),
    (
        "unreachable",
        Given(mission(do(JUMP, 1, 1), RTL, LAND)),
        3,
        Given(mission(do(JUMP, 3, 1), RTL, LAND)),
    ),
    ("no-ending", Given(mission(TAKEOFF, at(0, 9, 9))), 2, Given(flown(at(0, 9, 9)))),
    ("mixed-heights", Given(flown(at(0, 9, 600, frame=0))), 2, Given(flown(at(0, 9, 9, frame=6)))),
    ("jump-target", Given(flown(do(JUMP, 4, 1))), 2, Given(flown(do(JUMP, 3, 1)))),
    ("jump-target", Given(flown(do(JUMP, 0, 1))), 2, Given(flown(do(JUMP, 1, 1)))),
    ("jump-target", Given(flown(do(JUMP, NAN, 1)), PX4), 2, Given(flown(do(JUMP, 1, 1)), PX4)),
    (
        "jump-target",
        Given(flown(do(600, 7), do(601, 9, 1))),
        3,
        Given(flown(do(600, 7), do(601, 7))),
    ),
    (
        "jump-forever",
        Given(flown(do(600, 7), at(0, 9, 9), do(601, 7, -1))),
        4,
        Given(flown(do(600, 7), at(0, 9, 9), do(601, 7, 3))),
    ),
    (
        "jump-forever",
        Given(flown(at(0, 9, 9), do(JUMP, 2, -1))),
        3,
        Given(flown(at(0, 9, 9), do(JUMP, 2, 0))),
    ),
    (
        "same-place",
        Given(flown(at(0, 9, 9), at(0, 9.049, 9))),
        3,
        Given(flown(at(0, 9, 9), at(0, 9.051, 9))),
    ),
]


@pytest.mark.parametrize(("rule", "trips", "item", "passes"), CASES)
def test_the_rule_speaks_and_is_silent(
    rule: str, trips: Given, item: int | None, passes: Given
) -> None:
    check(rule, trips, item, passes)
