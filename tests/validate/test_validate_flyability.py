"""Speeds, corners and climbs."""

from dataclasses import replace

import pytest
from judged import (
    COPTER,
    PLANE,
    PX4,
    TAKEOFF,
    Given,
    at,
    check,
    flown,
    having,
    mission,
    row,
    speed,
    track,
)

from faao_mav.autopilot.body import CopterBody
from faao_mav.validate import Limits

OUT_AND_BACK = ((0, 0, 0), (0, 0, 30), (0, 100, 30), (0, 0, 30))

# the rule, what it speaks about, the item that it names, what it lets pass
CASES = [
    (
        "speed-not-reached",
        Given(flown(speed(8), *row(2, 34.2))),
        3,
        Given(flown(speed(8), *row(2, 34.4))),
    ),
    (
        "speed-not-reached",
        Given(flown(speed(8), *row(8, 16.3)), PX4),
        3,
        Given(flown(speed(8), *row(8, 16.5)), PX4),
    ),
    (
        "speed-not-reached",
        Given(flown(speed(8), *row(2, 34.2))),
        3,
        Given(flown(speed(8), *row(2, 34.2)), having(COPTER, WP_ACC=5.0, WP_JERK=20.0)),
    ),
    (
        "speed-not-reached",
        Given(flown(at(0, 50, 30), at(0, 150, 30)), track=track(OUT_AND_BACK, [0, 2, 3], 7.9)),
        3,
        Given(flown(at(0, 50, 30), at(0, 150, 30)), track=track(OUT_AND_BACK, [0, 2, 3], 8.1)),
    ),
    ("crawl", Given(flown(speed(8), *row(5, 5))), 3, Given(flown(speed(8), *row(4, 5)))),
    ("crawl", Given(flown(speed(8), *row(9, 5)), PX4), 3, Given(flown(speed(8), *row(9, 20)), PX4)),
    (
        "speed-above-limit",
        Given(flown(speed(8.9), at(0, 99, 30)), limits=Limits(max_speed=8)),
        3,
        Given(flown(speed(8.7), at(0, 99, 30)), limits=Limits(max_speed=8)),
    ),
    (
        "speed-headroom",
        Given(flown(speed(8.1), at(0, 99, 30)), limits=Limits(max_speed=8)),
        3,
        Given(flown(speed(8), at(0, 99, 30)), limits=Limits(max_speed=8)),
    ),
    (
        "speed-above-limit",
        Given(flown(at(0, 99, 30)), limits=Limits(max_speed=8)),
        2,
        Given(flown(at(0, 99, 30)), PX4, limits=Limits(max_speed=8)),
    ),
    ("speed-lean", Given(flown(speed(10.4))), 2, Given(flown(speed(10.3)))),
    (
        "speed-lean",
        Given(flown(speed(14.8)), having(COPTER, ANGLE_MAX=4500)),
        2,
        Given(flown(speed(14.7)), having(COPTER, ANGLE_MAX=4500)),
    ),
    (
        "speed-lean",
        Given(flown(speed(17.9)), having(PX4, MPC_TILTMAX_AIR=20)),
        2,
        Given(flown(speed(17.8)), having(PX4, MPC_TILTMAX_AIR=20)),
    ),
    (
        "speed-lean",
        Given(flown(speed(8)), replace(COPTER, body=CopterBody(linear_drag=1.0))),
        2,
        Given(flown(speed(20)), replace(COPTER, body=CopterBody(linear_drag=0, quadratic_drag=0))),
    ),
    (
        "acceleration-above-limit",
        Given(
            flown(),
            track=track(((0, 0, 0), (9, 0, 0), (0, 0, 0)), [0, 1], 3),
            limits=Limits(max_acceleration=5),
        ),
        1,
        Given(
            flown(),
            track=track(((0, 0, 0), (9, 0, 0), (18, 0, 0)), [0, 1], 3),
            limits=Limits(max_acceleration=5),
        ),
    ),
    (
        "sharp-corners",
        Given(mission(TAKEOFF, at(0, 99, 30), at(-71.1, 170, 30))),
        2,
        Given(mission(TAKEOFF, at(0, 99, 30), at(-70.9, 170, 30))),
    ),
    (
        "sharp-corners",
        Given(mission(TAKEOFF, speed(3.1), at(0, 99, 30), at(99, 99, 30))),
        3,
        Given(mission(TAKEOFF, speed(3), at(0, 99, 30), at(99, 99, 30))),
    ),
    (
        "sharp-corners",
        Given(mission(TAKEOFF, at(0, 99, 30), at(99, 99, 30)), PX4),
        2,
        Given(mission(TAKEOFF, at(0, 99, 30, 1), at(99, 99, 30)), PX4),
    ),
    (
        "turn-too-tight",
        Given(mission(TAKEOFF, at(0, 500, 30), at(14.6, 500, 30)), PLANE),
        2,
        Given(mission(TAKEOFF, at(0, 500, 30), at(14.8, 500, 30)), PLANE),
    ),
    (
        "steep-leg",
        Given(flown(at(0, 100, 30), at(0, 200, 62))),
        3,
        Given(flown(at(0, 100, 30), at(0, 200, 61))),
    ),
    (
        "steep-leg",
        Given(
            flown(at(0, 150, 62), at(0, 250, 43)),
        ),
        3,
        Given(flown(at(0, 150, 62), at(0, 250, 43.5))),
    ),
    (
        "steep-leg",
        Given(flown(at(0, 100, 62), at(0, 200, 114.2)), PLANE),
        3,
        Given(flown(at(0, 100, 62), at(0, 200, 114)), PLANE),
    ),
]


@pytest.mark.parametrize(("rule", "trips", "item", "passes"), CASES)
def test_the_rule_speaks_and_is_silent(
    rule: str, trips: Given, item: int | None, passes: Given
) -> None:
    check(rule, trips, item, passes)
