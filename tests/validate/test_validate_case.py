"""Where the items lie and how they are joined."""

import math

import numpy as np
import pytest
from judged import (
    COPTER,
    FRAME,
    HOME,
    PLANE,
    PX4,
    RTL,
    TAKEOFF,
    at,
    do,
    flown,
    having,
    latlon,
    mission,
    rally,
    raw,
    speed,
    track,
)

from faao_mav.autopilot import Vehicle
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import Command
from faao_mav.mission.item import MissionItem
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.straight import HOME as HOME_INDEX


def ups(case: ValidationContext) -> list[float]:
    return [place.up for place in case.places]


def test_heights_count_from_home_in_every_frame() -> None:
    items = (at(0, 9, 30), at(0, 9, 614, frame=0), at(0, 9, 614, frame=5), at(0, 9, 30, frame=6))
    assert ups(ValidationContext(mission(*items), COPTER)) == [30, 30, 30, 30]
    without = ValidationContext(mission(*items, home=None), COPTER)
    assert [math.isnan(up) for up in ups(without)] == [False, True, True, False]
    assert math.isnan(ups(ValidationContext(mission(at(0, 9, 30, frame=10)), COPTER))[0])


def test_places_are_where_they_were_put() -> None:
    case = ValidationContext(mission(at(120, -340, 30), at(-5, 6, 7)), COPTER)
    ground = np.array([(place.east, place.north) for place in case.places])
    assert ground == pytest.approx(np.array([(120, -340), (-5, 6)]), abs=1e-6)


def test_zero_zero_is_here_for_ardupilot_and_africa_for_px4() -> None:
    items = (at(10, 20, 30), raw(0, 0, 15))
    here = ValidationContext(mission(*items), COPTER).places[1]
    assert [here.east, here.north, here.up] == pytest.approx([10, 20, 15], abs=1e-6)
    assert len(ValidationContext(mission(*items), PX4).places) == 1


def test_legs_follow_items_jumps_and_the_way_home() -> None:
    items = (TAKEOFF, at(0, 100, 30), at(100, 100, 30), do(Command.DO_JUMP, 2, 1), RTL)
    legs = ValidationContext(mission(*items), COPTER).legs
    assert [(leg.index, leg.start.index, leg.end.index, leg.jump) for leg in legs] == [
        (0, HOME_INDEX, 0, False),
        (1, 0, 1, False),
        (2, 1, 2, False),
        (3, 2, 1, True),
        (4, 2, HOME_INDEX, False),
    ]
    assert [round(leg.length) for leg in legs] == [0, 100, 100, 100, 141]
    assert legs[0].rise == 30


@pytest.mark.parametrize(
    ("vehicle", "places", "expected"),
    [
        (COPTER, [(0, 250)], (0, 250)),  # of rally points and home the nearest
        (COPTER, [(0, 250), (0, 190)], (0, 190)),
        (COPTER, [(0, 450)], (0, 0)),
        (COPTER, [(0, 510)], (0, 0)),  # beyond RALLY_LIMIT_KM, 0.3
        (having(COPTER, RALLY_LIMIT_KM=0, RALLY_INCL_HOME=0), [(0, 1500)], (0, 1500)),
        (having(COPTER, RALLY_INCL_HOME=0), [(0, 480)], (0, 480)),
        (PLANE, [(0, 900)], (0, 900)),  # home is not among a plane's by default
        (PX4, [(0, 250)], (0, 250)),
        (having(PX4, RTL_TYPE=1), [(0, 900)], (0, 900)),
        (having(PX4, RTL_TYPE=2), [(0, 250)], (0, 0)),
    ],
)
def test_a_return_goes_where_the_vehicle_chooses(
    vehicle: Vehicle, places: list[tuple[float, float]], expected: tuple[float, float]
) -> None:
    points = tuple(rally(*place) for place in places)
    back = ValidationContext(flown(at(0, 200, 30), rally=points), vehicle).legs[-1].end
    assert (back.east, back.north) == pytest.approx(expected, abs=0.1)


def test_legs_lead_to_the_edge_of_circles() -> None:
    turns = at(0, 200, 30, 1, 0, 50, command=Command.NAV_LOITER_TURNS)
    to, away = ValidationContext(mission(TAKEOFF, turns, at(200, 200, 30)), COPTER).legs[1:]
    assert (to.end.east, to.end.north) == pytest.approx((0, 150), abs=0.1)
    assert (away.start.east, away.start.north) == pytest.approx((50, 200), abs=0.1)


@pytest.mark.parametrize(
    ("vehicle", "changes", "expected"),
    [
        (COPTER, [speed(8)], [8.0, 8.0]),
        (COPTER, [speed(8), speed(3, kind=2), speed(0)], [8.0] * 4),
        (having(COPTER, WPNAV_SPEED=700), [], [7.0]),
        (having(COPTER, WPNAV_SPEED=700, WP_SPD=6), [], [6.0]),
        (having(COPTER, WPNAV_SPEED=0), [], [10.0]),
        (PX4, [speed(8), speed(3, kind=2), speed(-1)], [8.0, 3.0, 5.0, 5.0]),
        (
            PLANE,
            [speed(15, kind=0), speed(18, kind=1), speed(-2, kind=0)],
            [15.0, 15.0, 12.0, 12.0],
        ),
    ],
)
def test_speeds_hold_from_change_to_change(
    vehicle: Vehicle, changes: list[MissionItem], expected: list[float]
) -> None:
    case = ValidationContext(mission(*changes, at(0, 9, 9)), vehicle)
    assert case.speeds == tuple(expected)


def test_a_track_in_another_frame_is_the_same_track() -> None:
    points = ((0, 0, 0), (0, 0, 30), (0, 100, 30))
    elsewhere = LocalFrame(*latlon(300, -200))
    moved = [(*elsewhere.to_local(*latlon(e, n)), u) for e, n, u in points]
    here = track(points, [0, 1], 5)
    case = ValidationContext(flown(), COPTER, here)
    other = ValidationContext(flown(), COPTER, track(moved, [0, 1], 5, frame=elsewhere))
    assert case.track_positions is here.position
    assert other.track_positions == pytest.approx(case.track_positions, abs=1e-3)


def test_without_home_the_first_place_is_the_origin() -> None:
    case = ValidationContext(mission(do(93, 1), at(5, 5, 9), home=None), COPTER)
    assert case.home is None
    assert case.frame == LocalFrame(*latlon(5, 5))
    assert ValidationContext(mission(do(93, 1), home=None), COPTER).frame is None
    assert ValidationContext(mission(home=HOME), COPTER).frame == FRAME
