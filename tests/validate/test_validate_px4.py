"""PX4's feasibility checks, and what it flies unexpectedly."""

import math

import pytest
from judged import (
    LAND,
    PX4,
    PX4_PLANE,
    RTL,
    TAKEOFF,
    Given,
    at,
    check,
    do,
    flown,
    having,
    mission,
    raw,
    speed,
)

from faao_mav.mission.command import Command
from faao_mav.mission.item import Mission, MissionItem

NAN = math.nan
DELAY, START = Command.NAV_DELAY, Command.DO_LAND_START
ACTUATOR = 187
STEEPEST = math.tan(math.radians(5.1))
"""The slope of FW_LND_ANG and of what PX4 lets pass beyond it."""


def takeoff(up: float, east: float = 0.0, frame: int = 3) -> MissionItem:
    return at(east, 0, up, command=Command.NAV_TAKEOFF, frame=frame)


def landing(height: float, distance: float, *params: float, command: int = 16) -> Mission:
    """An approach from `height` and `distance` to a landing at home."""
    entrance = at(0, distance, height, *params, command=command)
    return mission(takeoff(30), at(0, 500, 60), entrance, LAND)


# the rule, what it speaks about, the item that it names, what it lets pass
CASES = [
    ("px4-command-rejected", Given(flown(do(112, 3)), PX4), 2, Given(flown(do(93, 3)), PX4)),
    (
        "px4-vtol-items",
        Given(mission(at(0, 0, 30, command=84)), PX4),
        1,
        Given(mission(TAKEOFF), PX4),
    ),
    ("px4-vtol-items", Given(flown(do(3000, 3)), PX4_PLANE), 2, Given(flown(), PX4_PLANE)),
    (
        "jump-in-place",
        Given(flown(speed(5), do(177, 2, 3)), PX4),
        3,
        Given(flown(speed(5), do(177, 2, 3))),
    ),
    (
        "jump-in-place",
        Given(flown(speed(5), do(177, 2, -1)), PX4),
        3,
        Given(flown(speed(5), do(177, 3, 3)), PX4),
    ),
    (
        "jump-in-place",
        Given(flown(speed(5), do(177, 2, 1)), PX4),
        3,
        Given(flown(at(0, 9, 9), do(177, 2, 1)), PX4),
    ),
    ("px4-nothing-to-fly", Given(mission(speed(5), do(206, 0)), PX4), None, Given(flown(), PX4)),
    ("px4-starts-with-land", Given(mission(LAND), PX4), 1, Given(mission(at(0, 9, 9), LAND), PX4)),
    (
        "px4-takeoff-first",
        Given(mission(at(0, 9, 9), TAKEOFF), PX4),
        2,
        Given(mission(speed(5), do(DELAY, 1), TAKEOFF), PX4),
    ),
    (
        "px4-takeoff-first",
        Given(mission(TAKEOFF, at(0, 9, 9), TAKEOFF), PX4),
        3,
        Given(mission(TAKEOFF, at(0, 9, 9)), PX4),
    ),
    (
        "px4-takeoff-first",
        Given(mission(do(ACTUATOR), TAKEOFF), PX4),
        2,
        Given(mission(do(197), TAKEOFF), PX4),
    ),
    ("px4-takeoff-altitude", Given(mission(takeoff(0)), PX4), 1, Given(mission(takeoff(0.1)), PX4)),
    (
        "px4-takeoff-altitude",
        Given(mission(takeoff(584, frame=0)), PX4),
        1,
        Given(mission(takeoff(584.1, frame=0)), PX4),
    ),
    ("px4-takeoff-low", Given(mission(takeoff(2.9)), PX4), 1, Given(mission(takeoff(3)), PX4)),
    (
        "px4-takeoff-low",
        Given(mission(takeoff(3.9)), having(PX4, MIS_TAKEOFF_ALT=4)),
        1,
        Given(mission(takeoff(4)), having(PX4, MIS_TAKEOFF_ALT=4)),
    ),
    (
        "px4-takeoff-low",
        Given(mission(takeoff(10.9)), PX4_PLANE),
        1,
        Given(mission(takeoff(11)), PX4_PLANE),
    ),
    (
        "px4-takeoff-or-landing-missing",
        Given(mission(at(0, 9, 9)), having(PX4, MIS_TKO_LAND_REQ=1)),
        None,
        Given(mission(TAKEOFF), having(PX4, MIS_TKO_LAND_REQ=1)),
    ),
    (
        "px4-takeoff-or-landing-missing",
        Given(flown(), having(PX4, MIS_TKO_LAND_REQ=2)),
        None,
        Given(mission(at(0, 9, 9), LAND), having(PX4, MIS_TKO_LAND_REQ=2)),
    ),
    (
        "px4-takeoff-or-landing-missing",
        Given(flown(), having(PX4, MIS_TKO_LAND_REQ=3)),
        None,
        Given(mission(TAKEOFF, LAND), having(PX4, MIS_TKO_LAND_REQ=3)),
    ),
    (
        "px4-takeoff-or-landing-missing",
        Given(flown(), having(PX4, MIS_TKO_LAND_REQ=4)),
        None,
        Given(mission(at(0, 9, 9)), having(PX4, MIS_TKO_LAND_REQ=4)),
    ),
    (
        "px4-takeoff-or-landing-missing",
        Given(mission(at(0, 9, 9), LAND), having(PX4, MIS_TKO_LAND_REQ=5)),
        None,
        Given(flown(), having(PX4, MIS_TKO_LAND_REQ=0)),
    ),
    (
        "px4-first-waypoint-far",
        Given(mission(at(0, 10_000.1, 30)), PX4),
        1,
        Given(mission(at(0, 9_999.9, 30)), PX4),
    ),
    (
        "px4-first-waypoint-far",
        Given(mission(at(0, 900.1, 30)), having(PX4, MIS_DIST_1WP=900)),
        1,
        Given(mission(at(0, 20_000, 30)), having(PX4, MIS_DIST_1WP=0)),
    ),
    (
        "px4-max-horizontal",
        Given(flown(at(0, 100.1, 30)), having(PX4, GF_MAX_HOR_DIST=100)),
        2,
        Given(flown(at(0, 99.9, 30)), having(PX4, GF_MAX_HOR_DIST=100)),
    ),
    (
        "px4-max-horizontal",
        Given(flown(at(0, 101, 30)), having(PX4, GF_MAX_HOR_DIST=100)),
        2,
        Given(flown(at(0, 101, 30)), PX4),
    ),
    (
        "px4-max-vertical",
        Given(flown(at(0, 9, 50.1)), having(PX4, GF_MAX_VER_DIST=50)),
        2,
        Given(flown(at(0, 9, 50)), having(PX4, GF_MAX_VER_DIST=50)),
    ),
    (
        "px4-approach-entrance",
        Given(landing(9, 200, command=17), PX4_PLANE),
        4,
        Given(landing(9, 200), PX4_PLANE),
    ),
    (
        "px4-approach-below",
        Given(landing(0, 200), PX4_PLANE),
        4,
        Given(landing(0.1, 200), PX4_PLANE),
    ),
    (
        "px4-approach-orbit",
        Given(landing(9, 199.9, 0, 200, command=31), PX4_PLANE),
        4,
        Given(landing(9, 200.1, 0, 200, command=31), PX4_PLANE),
    ),
    (
        "px4-approach-steep",
        Given(landing(200 * STEEPEST + 0.1, 200), PX4_PLANE),
        4,
        Given(landing(200 * STEEPEST - 0.1, 200), PX4_PLANE),
    ),
    (
        "px4-approach-steep",
        Given(landing(30, 200), PX4_PLANE),
        4,
        Given(landing(30, 200), having(PX4_PLANE, FW_LND_ANG=9)),
    ),
    (
        "px4-approach-steep",
        Given(landing(4 * STEEPEST * 100 + 0.1, 500, 0, 300, command=31), PX4_PLANE),
        4,
        Given(landing(4 * STEEPEST * 100 - 0.1, 500, 0, 300, command=31), PX4_PLANE),
    ),
    (
        "px4-land-start",
        Given(mission(TAKEOFF, do(START), do(START), at(0, 300, 9), LAND), PX4_PLANE),
        3,
        Given(mission(TAKEOFF, do(START), at(0, 300, 9), LAND), PX4_PLANE),
    ),
    (
        "px4-land-start",
        Given(mission(TAKEOFF, do(START), RTL, LAND), PX4_PLANE),
        3,
        Given(mission(TAKEOFF, RTL, do(START), LAND), PX4_PLANE),
    ),
    (
        "px4-land-start",
        Given(mission(TAKEOFF, at(0, 300, 9), LAND, do(START)), PX4_PLANE),
        4,
        Given(mission(TAKEOFF, do(START), LAND), PX4_PLANE),
    ),
    (
        "px4-null-island",
        Given(mission(raw(0, 0, 30, command=22)), PX4),
        1,
        Given(mission(raw(0, 1e-6, 30, command=22)), PX4),
    ),
    (
        "px4-altitude-missing",
        Given(flown(at(0, 9, NAN)), PX4),
        2,
        Given(flown(at(0, 9, 9, NAN, NAN, NAN, NAN)), PX4),
    ),
    ("px4-speed-default", Given(flown(speed(NAN)), PX4), 2, Given(flown(speed(0.1)), PX4)),
    ("px4-speed-type", Given(flown(speed(2, kind=2)), PX4), 2, Given(flown(speed(2, kind=0)), PX4)),
    ("px4-speed-capped", Given(flown(speed(12.1)), PX4), 2, Given(flown(speed(12)), PX4)),
    (
        "px4-speed-capped",
        Given(flown(speed(15.1)), having(PX4, MPC_XY_VEL_MAX=15)),
        2,
        Given(flown(speed(15)), having(PX4, MPC_XY_VEL_MAX=15)),
    ),
    (
        "px4-plane-speed",
        Given(flown(speed(20.1)), PX4_PLANE),
        2,
        Given(flown(speed(20)), PX4_PLANE),
    ),
    (
        "px4-radius-covers-leg",
        Given(flown(at(0, 9, 30), at(0, 29, 30, 0, 20.1)), PX4),
        3,
        Given(flown(at(0, 9, 30), at(0, 29, 30, 0, 19.9)), PX4),
    ),
    (
        "px4-radius-small",
        Given(flown(at(0, 50, 30, 0, 0.9)), PX4),
        2,
        Given(flown(at(0, 50, 30, 0, 1)), PX4),
    ),
    (
        "px4-radius-narrows",
        Given(flown(at(0, 50, 30, 0, 9.9), at(15, 99, 30, 0, 1.5)), PX4),
        2,
        Given(flown(at(0, 50, 30, 0, 9.9), at(15, 99, 30, 0, 9.9)), PX4),
    ),
    (
        "px4-radius-narrows",
        Given(flown(at(0, 50, 30, 0, 9.9), at(15, 99, 30)), PX4),
        2,
        Given(flown(at(0, 50, 30, 3, 9.9), at(15, 99, 30)), PX4),
    ),
    (
        "px4-takeoff-elsewhere",
        Given(mission(takeoff(30, east=2.1)), PX4),
        1,
        Given(mission(takeoff(30, east=1.9)), PX4),
    ),
    (
        "px4-stops",
        Given(flown(at(0, 9, 9, autocontinue=False)), PX4),
        2,
        Given(mission(TAKEOFF, at(0, 9, 9, autocontinue=False)), PX4),
    ),
]


@pytest.mark.parametrize(("rule", "trips", "item", "passes"), CASES)
def test_the_rule_speaks_and_is_silent(
    rule: str, trips: Given, item: int | None, passes: Given
) -> None:
    check(rule, trips, item, passes)
