"""What is refused on upload."""

import math

import pytest
from judged import (
    COPTER,
    PLANE,
    PX4,
    TAKEOFF,
    Given,
    at,
    check,
    circle,
    do,
    fence,
    flown,
    having,
    mission,
    rally,
    raw,
    row,
    spline,
    square,
)

from faao_mav.mission.command import Command

JUMP, NAN = Command.DO_JUMP, math.nan

# the rule, what it speaks about, the item that it names, what it lets pass
CASES = [
    (
        "refused-on-upload",
        Given(flown(at(0, 9, 9, frame=1))),
        2,
        Given(flown(at(0, 9, 9, frame=10))),
    ),
    (
        "refused-on-upload",
        Given(flown(at(0, 9, 9, frame=10)), PX4),
        2,
        Given(flown(at(0, 9, 9, frame=5)), PX4),
    ),
    (
        "not-set",
        Given(flown(at(0, 9, 9, 0, NAN))),
        2,
        Given(flown(at(0, 9, 9, 0, 0, 0, NAN))),
    ),
    ("not-set", Given(flown(do(2001, 0, NAN))), 2, Given(flown(do(2001, 0, NAN)), PX4)),
    ("refused-on-upload", Given(flown(spline(0, 9)), PLANE), 2, Given(flown(spline(0, 9)))),
    ("refused-on-upload", Given(flown(spline(0, 9)), PX4), 2, Given(flown(at(0, 9, 9)), PX4)),
    ("refused-on-upload", Given(flown(at(0, 9, 83_000))), 2, Given(flown(at(0, 9, 82_999)))),
    ("refused-on-upload", Given(flown(raw(90.1, 0, 9))), 2, Given(flown(raw(90, 0, 9)))),
    (
        "refused-on-upload",
        Given(flown(raw(0, -180.1, 9)), PX4),
        2,
        Given(flown(raw(0, -180, 9)), PX4),
    ),
    ("refused-on-upload", Given(flown(raw(NAN, 0, 9))), 2, Given(flown(raw(1, 1, 9)))),
    (
        "refused-on-upload",
        Given(flown(do(178, 1, 5, frame=3)), PX4),
        2,
        Given(flown(do(178, 1, 5)), PX4),
    ),
    (
        "refused-on-upload",
        Given(mission(TAKEOFF, do(20, frame=3)), PX4),
        2,
        Given(mission(TAKEOFF, do(20, frame=3))),
    ),
    (
        "refused-on-upload",
        Given(flown(at(0, 9, 9, frame=2)), PX4),
        2,
        Given(flown(at(0, 9, 9, frame=6)), PX4),
    ),
    ("refused-on-upload", Given(flown(do(9999))), 2, Given(flown(do(207, 1)))),
    ("storage-full", Given(mission(*row(718, 30))), None, Given(mission(*row(717, 30)))),
    ("number-too-large", Given(flown(at(0, 9, 9, 3.5e38))), 2, Given(flown(at(0, 9, 9, 3.4e38)))),
    (
        "storage-full",
        Given(mission(*row(724, 30)), PLANE),
        None,
        Given(mission(*row(724, 30)), having(PLANE, BRD_SD_MISSION=64)),
    ),
    ("storage-tight", Given(mission(*row(650, 30))), None, Given(mission(*row(649, 30)))),
    (
        "storage-tight",
        Given(mission(*row(1001, 30)), PX4),
        None,
        Given(mission(*row(1000, 30)), PX4),
    ),
    (
        "many-jumps",
        Given(mission(TAKEOFF, *[do(JUMP, 1, 1)] * 16)),
        17,
        Given(mission(TAKEOFF, *[do(JUMP, 1, 1)] * 15)),
    ),
    (
        "many-jumps",
        Given(mission(TAKEOFF, *[do(JUMP, 1, 1)] * 16)),
        17,
        Given(mission(TAKEOFF, *[do(JUMP, 1, 1)] * 16), PX4),
    ),
    ("ardupilot-command-skipped", Given(flown(do(115, 90)), PLANE), 2, Given(flown(do(115, 90)))),
    ("ardupilot-frame-mission", Given(flown(at(0, 9, 9, frame=2))), 2, Given(flown(at(0, 9, 9)))),
    ("ardupilot-terrain", Given(flown(at(0, 9, 9, frame=10))), 2, Given(flown(at(0, 9, 9)))),
    (
        "ardupilot-terrain",
        Given(flown(at(0, 9, 9, frame=11)), having(COPTER, TERRAIN_ENABLE=0)),
        2,
        Given(flown(at(0, 9, 9)), having(COPTER, TERRAIN_ENABLE=0)),
    ),
    (
        "px4-roi",
        Given(flown(at(0, 9, 9, 1, command=201)), PX4),
        2,
        Given(flown(at(0, 9, 9, 3, command=201)), PX4),
    ),
    ("px4-roi", Given(flown(do(201, 3)), PX4), 2, Given(flown(do(201, 2)), PX4)),
    (
        "px4-fence-size",
        Given(flown(fence=fence(*[square(500)] * 16, circle(0, 0, 9, inclusion=True))), PX4),
        None,
        Given(flown(fence=fence(*[square(500)] * 16)), PX4),
    ),
    (
        "px4-fence-size",
        Given(flown(rally=(rally(0, 0),) * 9), PX4),
        None,
        Given(flown(rally=(rally(0, 0),) * 8), PX4),
    ),
]


@pytest.mark.parametrize(("rule", "trips", "item", "passes"), CASES)
def test_the_rule_speaks_and_is_silent(
    rule: str, trips: Given, item: int | None, passes: Given
) -> None:
    check(rule, trips, item, passes)
