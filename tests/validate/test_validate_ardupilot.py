"""What ArduPilot does not arm for or start, and what it flies unexpectedly."""

import pytest
from judged import (
    COPTER,
    LAND,
    PLANE,
    RTL,
    TAKEOFF,
    Given,
    at,
    check,
    do,
    flown,
    having,
    mission,
    rally,
    raw,
    speed,
    spline,
)

from faao_mav.mission.command import Command

DELAY, START, SET_HOME = Command.NAV_DELAY, Command.DO_LAND_START, Command.DO_SET_HOME

# the rule, what it speaks about, the item that it names, what it lets pass
CASES = [
    (
        "ardupilot-required-item",
        Given(flown(), having(COPTER, ARMING_MIS_ITEMS=1)),
        None,
        Given(mission(TAKEOFF, LAND), having(COPTER, ARMING_MIS_ITEMS=1)),
    ),
    (
        "ardupilot-required-item",
        Given(mission(TAKEOFF, LAND), having(COPTER, ARMING_MIS_ITEMS=72)),
        None,
        Given(flown(), having(COPTER, ARMING_MIS_ITEMS=72)),
    ),
    (
        "ardupilot-required-rally",
        Given(flown(rally=(rally(0, 300.1),)), having(COPTER, ARMING_MIS_ITEMS=32)),
        None,
        Given(flown(rally=(rally(0, 299.9),)), having(COPTER, ARMING_MIS_ITEMS=32)),
    ),
    (
        "ardupilot-required-rally",
        Given(flown(), having(COPTER, ARMING_MIS_ITEMS=32)),
        None,
        Given(flown(rally=(rally(0, 9e4),)), having(COPTER, ARMING_MIS_ITEMS=32, RALLY_LIMIT_KM=0)),
    ),
    (
        "ardupilot-no-takeoff",
        Given(mission(at(0, 9, 9))),
        None,
        Given(mission(TAKEOFF, at(0, 9, 9))),
    ),
    (
        "ardupilot-no-takeoff",
        Given(mission(at(0, 0, 30, command=84)), PLANE),
        None,
        Given(mission(at(0, 0, 30, command=84))),
    ),
    (
        "ardupilot-no-takeoff",
        Given(mission(at(0, 9, 9))),
        None,
        Given(mission(at(0, 9, 9)), airborne=True),
    ),
    (
        "ardupilot-takeoff-first",
        Given(mission(at(0, 9, 9), TAKEOFF)),
        2,
        Given(mission(speed(5), do(DELAY, 3), TAKEOFF)),
    ),
    (
        "ardupilot-begins-in-the-air",
        Given(mission(at(0, 9, 9)), airborne=True),
        None,
        Given(mission(at(0, 9, 9))),
    ),
    (
        "ardupilot-takeoff-first",
        Given(mission(at(0, 9, 9), TAKEOFF), PLANE),
        2,
        Given(mission(at(0, 9, 9), TAKEOFF), PLANE, airborne=True),
    ),
    (
        "ardupilot-land-start",
        Given(mission(TAKEOFF, do(START), at(0, 300, 9), LAND), PLANE),
        2,
        Given(mission(TAKEOFF, do(START), at(0, 300, 9), LAND), having(PLANE, RTL_AUTOLAND=2)),
    ),
    (
        "ardupilot-land-start",
        Given(mission(TAKEOFF, do(START), LAND), PLANE),
        2,
        Given(mission(TAKEOFF, do(START), LAND)),
    ),
    (
        "ardupilot-land-approach",
        Given(mission(TAKEOFF, LAND), PLANE),
        2,
        Given(mission(TAKEOFF, at(0, 300, 9), LAND), PLANE),
    ),
    (
        "ardupilot-spline-last",
        Given(mission(TAKEOFF, at(0, 9, 9), spline(0, 40), speed(5))),
        3,
        Given(mission(TAKEOFF, at(0, 9, 9), spline(0, 40), spline(0, 80))),
    ),
    (
        "ardupilot-spline-last",
        Given(mission(TAKEOFF, spline(0, 40))),
        2,
        Given(mission(TAKEOFF, spline(0, 40), RTL)),
    ),
    (
        "ardupilot-set-home",
        Given(flown(do(SET_HOME, 1))),
        2,
        Given(mission(do(SET_HOME, 1), TAKEOFF)),
    ),
    (
        "ardupilot-set-home",
        Given(mission(do(SET_HOME, 1), at(0, 9, 9)), airborne=True),
        1,
        Given(flown(at(0, 9, 584.5, command=SET_HOME, frame=0))),
    ),
    ("ardupilot-guided", Given(flown(do(92, 1))), 2, Given(flown(do(92, 0)))),
    ("ardupilot-command-skipped", Given(flown(do(DELAY, 5)), PLANE), 2, Given(flown(do(DELAY, 5)))),
    ("ardupilot-command-skipped", Given(flown(do(92, 1)), PLANE), 2, Given(flown(do(92, 1)))),
    (
        "ardupilot-fence-ceiling",
        Given(flown(at(0, 9, 100.1)), having(COPTER, FENCE_ENABLE=1)),
        2,
        Given(flown(at(0, 9, 100)), having(COPTER, FENCE_ENABLE=1)),
    ),
    (
        "ardupilot-fence-ceiling",
        Given(flown(at(0, 9, 101)), having(COPTER, FENCE_ENABLE=1)),
        2,
        Given(flown(at(0, 9, 101)), having(COPTER, FENCE_ENABLE=1, FENCE_TYPE=6)),
    ),
    (
        "ardupilot-fence-floor",
        Given(flown(at(0, 9, 4.9)), having(COPTER, FENCE_ENABLE=1, FENCE_TYPE=8, FENCE_ALT_MIN=5)),
        2,
        Given(flown(at(0, 9, 5)), having(COPTER, FENCE_ENABLE=1, FENCE_TYPE=8, FENCE_ALT_MIN=5)),
    ),
    (
        "ardupilot-fence-circle",
        Given(flown(at(0, 300.1, 9)), having(COPTER, FENCE_ENABLE=1)),
        2,
        Given(flown(at(0, 299.9, 9)), having(COPTER, FENCE_ENABLE=1)),
    ),
    (
        "ardupilot-fence-circle",
        Given(flown(at(0, 301, 9)), having(COPTER, FENCE_ENABLE=1)),
        2,
        Given(flown(at(0, 301, 9)), COPTER),
    ),
    (
        "ardupilot-spline-delay",
        Given(flown(spline(0, 9), do(DELAY, 3))),
        3,
        Given(flown(at(0, 9, 9), do(DELAY, 3))),
    ),
    (
        "ardupilot-spline-delay",
        Given(flown(spline(0, 9), speed(5), do(DELAY, 3))),
        4,
        Given(flown(spline(0, 9), at(0, 20, 9), do(DELAY, 3))),
    ),
    (
        "ardupilot-stays",
        Given(flown(raw(0, 0, 30))),
        2,
        Given(flown(raw(0, 1, 30), raw(0, 0, 0, command=21))),
    ),
    ("ardupilot-speed-ignored", Given(flown(speed(0))), 2, Given(flown(speed(0.1)))),
    ("ardupilot-speed-ignored", Given(flown(speed(5, kind=4))), 2, Given(flown(speed(5, kind=3)))),
    (
        "ardupilot-speed-ignored",
        Given(flown(speed(-1, kind=0)), PLANE),
        2,
        Given(flown(do(178, 0, -1, 60)), PLANE),
    ),
    (
        "ardupilot-plane-speed",
        Given(flown(speed(8.9, kind=0)), PLANE),
        2,
        Given(flown(speed(9, kind=0)), PLANE),
    ),
    (
        "ardupilot-plane-speed",
        Given(flown(speed(22.1, kind=0)), PLANE),
        2,
        Given(flown(speed(22, kind=0)), PLANE),
    ),
]


@pytest.mark.parametrize(("rule", "trips", "item", "passes"), CASES)
def test_the_rule_speaks_and_is_silent(
    rule: str, trips: Given, item: int | None, passes: Given
) -> None:
    check(rule, trips, item, passes)
