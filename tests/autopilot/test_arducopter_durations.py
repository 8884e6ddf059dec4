"""How long legs are told to take, against the target that the autopilot moves along them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.ardupilot.copter import ArduCopter
from faao_mav.autopilot.ardupilot.copter.durations import StraightDurations
from faao_mav.autopilot.ardupilot.copter.leg import ArduCopterLegs
from faao_mav.autopilot.ardupilot.copter.route import Router


def moved(lengths: Real, stops: Flags, speeds: Real, acceleration: float, jerk: float) -> Real:
    """How long the target takes from passing one point of a straight way to passing the next, s."""
    points = np.zeros((len(lengths) + 1, 3))
    points[1:, 0] = np.cumsum(lengths)
    limits = ArduCopter(acceleration=acceleration, jerk=jerk)
    router = Router(points, np.zeros(len(points), dtype=bool), stops, limits)
    return np.diff(router.course(speeds.tolist(), [0.0] * len(points)).passed)


def told(
    lengths: Real, stops: Flags, speeds: Real, acceleration: float, jerk: float
) -> tuple[Real, Real]:
    bounds = ArduCopterLegs(acceleration=acceleration, jerk=jerk).bounds
    return StraightDurations(lengths, ~stops[:-1], bounds).flown(speeds)


def resting(points: int) -> Flags:
    """Stops at the ends alone."""
    stops = np.zeros(points, dtype=bool)
    stops[[0, -1]] = True
    return stops


@given(
    st.lists(st.floats(50, 300), min_size=1, max_size=5),
    st.floats(1, 7),
    st.floats(2, 5),
    st.floats(5, 20),
    st.data(),
)
def test_long_legs_at_one_speed_take_what_the_target_takes(
    ways: list[float], speed: float, acceleration: float, jerk: float, data: st.DataObject
) -> None:
    lengths, stops = np.array(ways), resting(len(ways) + 1)
    inside = st.lists(st.booleans(), min_size=len(ways) - 1, max_size=len(ways) - 1)
    stops[1:-1] = data.draw(inside)
    speeds = np.full(len(ways), speed)
    flown, durations = told(lengths, stops, speeds, acceleration, jerk)
    assert flown == pytest.approx(speeds)
    assert durations == pytest.approx(moved(lengths, stops, speeds, acceleration, jerk), abs=0.05)


def test_legs_at_other_speeds_take_what_the_target_takes() -> None:
    rng, worst = np.random.default_rng(1), []
    for _ in range(300):
        legs = int(rng.integers(2, 7))
        route = rng.uniform(8, 120, legs), resting(legs + 1), rng.uniform(1.5, 10, legs)
        limits = rng.uniform(1.5, 5), rng.uniform(5, 20)
        worst.append(np.abs(told(*route, *limits)[1] - moved(*route, *limits)).max())
    assert np.median(worst) < 0.05
    assert np.quantile(worst, 0.9) < 0.3


def test_a_short_leg_keeps_the_speed_that_it_was_begun_at() -> None:
    lengths, stops = np.array([60.0, 24.0, 60.0]), resting(4)
    for command in (5.0, 6.0, 8.0):
        flown, _ = told(lengths, stops, np.array([5.0, command, 8.0]), 4.0, 10.0)
        assert flown == pytest.approx([5.0, 5.0, 8.0])
    stops[1] = True  # a leg that begins at rest is planned at its own speed
    assert told(lengths, stops, np.array([5.0, 8.0, 8.0]), 4.0, 10.0)[0][1] == pytest.approx(8.0)


def test_a_command_counts_up_to_what_a_leg_or_the_next_comes_to() -> None:
    bounds = ArduCopterLegs(acceleration=4.0, jerk=10.0).bounds
    lengths = np.array([12.0, 40.0, 6.0])
    alone, joined = (
        StraightDurations(lengths, np.array([False, follows, follows]), bounds)
        for follows in (False, True)
    )
    speeds = np.array([20.0, 20.0, 20.0])
    assert alone.most == pytest.approx(alone.flown(speeds)[0])
    assert joined.most == pytest.approx(alone.most[[1, 1, 2]])
    assert joined.flown(speeds)[1] == pytest.approx(joined.flown(joined.most)[1])


def test_many_speeds_at_once_are_told_as_one_by_one() -> None:
    bounds = ArduCopterLegs(acceleration=3.0, jerk=5.0).bounds
    legs = StraightDurations(np.array([30.0, 9.0, 55.0]), np.array([False, True, True]), bounds)
    speeds = np.random.default_rng(0).uniform(1, 9, (2, 4, 3))
    flown, durations = legs.flown(speeds)
    for k in np.ndindex(2, 4):
        one = legs.flown(speeds[k])
        assert one[0] == pytest.approx(flown[k], rel=1e-12)
        assert one[1] == pytest.approx(durations[k], rel=1e-12)


def test_legs_of_no_length_have_durations() -> None:
    bounds = ArduCopterLegs().bounds
    legs = StraightDurations(np.zeros(2), np.array([False, True]), bounds)
    assert all(math.isfinite(x) for x in np.ravel(legs.flown(np.array([5.0, 5.0]))))
