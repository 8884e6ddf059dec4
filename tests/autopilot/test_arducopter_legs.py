"""ArduCopter's legs and corners against kinematics in closed form and their limits."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.autopilot.ardupilot.copter.leg import at_speed, planned
from faao_mav.autopilot.ardupilot.copter.parameters import ArduCopterLimits
from faao_mav.autopilot.ardupilot.copter.ramp import LegBounds
from faao_mav.autopilot.ardupilot.copter.route import half_overlap

LIMITS = LegBounds(speed=8.0, acceleration=2.5, jerk=1.0, rise=0.3)

limits = st.builds(
    LegBounds,
    speed=st.floats(0.5, 15),
    acceleration=st.floats(0.5, 8),
    jerk=st.floats(0.5, 20),
    rise=st.floats(0.2, 0.6),
)


@given(limits, st.floats(0.01, 500))
def test_a_leg_keeps_its_limits_and_ends_at_rest(bounds: LegBounds, length: float) -> None:
    leg = planned(length, bounds)
    t = np.linspace(0, leg.duration, 801)
    s, v, a = np.array([leg.at(x) for x in t]).T
    jerk = np.gradient(a, t)
    assert s[0] == 0
    assert s[-1] == pytest.approx(length, rel=1e-6)
    assert v[-1] == pytest.approx(0, abs=1e-6 * bounds.speed)
    assert np.all(np.diff(s) > -1e-9)
    assert v.max() <= bounds.speed * (1 + 1e-9)
    assert abs(a).max() <= bounds.acceleration * (1 + 1e-9)
    assert abs(jerk).max() <= bounds.jerk * (1 + 1e-3)


@given(limits, st.floats(0.01, 500))
def test_distance_is_the_integral_of_speed_and_speed_that_of_acceleration(
    bounds: LegBounds, length: float
) -> None:
    leg = planned(length, bounds)
    t = np.linspace(0, leg.duration, 2001)
    s, v, a = np.array([leg.at(x) for x in t]).T
    h = t[1]
    slack = bounds.jerk * h * h  # of the trapezoidal rule
    assert np.abs(np.cumsum(a[1:] + a[:-1]) * h / 2 - v[1:]).max() <= 4 * slack
    assert np.abs(np.cumsum(v[1:] + v[:-1]) * h / 2 - s[1:]).max() <= 4 * slack * t[-1]


def test_a_long_leg_has_two_full_ramps_and_a_cruise() -> None:
    # D = dv/A + A/J + t_j, S = v/2 D, T = 2 D + (L - 2 S)/v
    duration = 8 / 2.5 + 2.5 / 1 + 0.3
    leg = planned(200, LIMITS)
    assert leg.up.duration == pytest.approx(duration)
    assert leg.up.length == pytest.approx(4 * duration)
    assert leg.duration == pytest.approx(2 * duration + (200 - 8 * duration) / 8)
    assert planned(400, LIMITS).duration - leg.duration == pytest.approx(200 / 8)


def test_a_ramp_that_never_reaches_the_acceleration() -> None:
    # a²/J + a t_j = v, D = 2 (a/J + t_j)
    a = (math.sqrt(0.3**2 + 4 * 2) - 0.3) / 2
    leg = planned(100, replace(LIMITS, speed=2.0))
    assert leg.up.peak == pytest.approx(a)
    assert leg.up.duration == pytest.approx(2 * (a + 0.3))


def test_measured_lengths_that_reach_8_metres_per_second() -> None:
    assert 48 < 2 * planned(500, LIMITS).up.length < 50
    quick = LegBounds(8.0, 4.0, 10.0, 0.3)
    assert 21 < 2 * planned(500, quick).up.length < 23


@pytest.mark.parametrize(
    ("length", "before", "told", "reached"),
    [(11.3, 1.992, 3.764, 2.32), (24.6, 3.764, 8.202, 4.79), (44.8, 7.71, 8.81, 7.71)],
)
def test_measured_speeds_after_a_change_on_a_short_leg(
    length: float, before: float, told: float, reached: float
) -> None:
    """As ArduCopter's log has them: legs of a mission with WPNAV_ACCEL 400 and WPNAV_JERK 20."""
    own = ArduCopterLimits(acceleration=4.0, jerk=20.0)
    leg = at_speed(planned(length, LegBounds(before, 4.0, 20.0, own.rise)), told, elapsed=0.3)
    assert max(v for _, v, _ in leg.states) == pytest.approx(reached, abs=0.03)


def test_the_jerk_rises_no_faster_than_the_aircraft_leans() -> None:
    """Half of what leaning at 1100 degrees/s² gives is slower than ATC_INPUT_TC from 18 m/s³ on."""
    assert ArduCopterLimits(jerk=17).rise == pytest.approx(0.3)
    half = 9.80665 * math.radians(1100) / 2
    assert ArduCopterLimits(jerk=20).rise == pytest.approx(math.pi * 20 / (2 * half))
    assert ArduCopterLimits(jerk=20, roll_acceleration=0, pitch_acceleration=0).rise == 0.3


@given(limits, st.floats(20, 300), st.floats(0.3, 15), st.floats(0, 1))
def test_a_speed_change_keeps_what_was_flown_and_the_end(
    bounds: LegBounds, length: float, speed: float, share: float
) -> None:
    before = planned(length, bounds)
    elapsed = share * before.up.duration / 2
    after = at_speed(before, speed, elapsed)
    t = np.linspace(0, elapsed, 30) if elapsed > 0 else np.zeros(1)
    if elapsed > 0:
        flown = [before.at(x) for x in t]
        np.testing.assert_allclose([after.at(x) for x in t], flown, atol=1e-6, rtol=1e-6)
    assert after.at(after.duration)[0] == pytest.approx(length, rel=1e-6)
    assert max(v for _, v, _ in after.states) <= max(speed, bounds.speed) * (1 + 1e-9)


@given(limits, st.floats(0.01, 300), st.floats(0, 12), st.floats(0, 12))
def test_a_leg_between_splines_has_its_length(
    bounds: LegBounds, length: float, start: float, end: float
) -> None:
    leg = planned(length, bounds, start=start, end=end)
    assert leg.states[-1][0] == pytest.approx(length, rel=1e-6)
    assert leg.states[-1][1] == pytest.approx(leg.final, abs=1e-6)
    assert leg.states[0][1] <= start


@pytest.mark.parametrize("degrees", [5, 30, 90, 150])
def test_corners_are_as_early_as_their_limits_allow(degrees: float) -> None:
    angle = math.radians(degrees)
    u, w = (1.0, 0.0, 0.0), (math.cos(angle), math.sin(angle), 0.0)
    leg = planned(100, LIMITS)
    bounds = ArduCopterLimits(radius=2.0, corner_acceleration=5.0, climb_acceleration=1.0)
    h = half_overlap(leg, u, leg, w, bounds)
    left = 100 - leg.at(leg.duration - h)[0]
    apart = 2 * left * math.sin(angle / 2)
    speed = 2 * leg.at(h)[1] * math.cos(angle / 2)
    assert apart <= 2.0 + 1e-6
    assert speed <= 8.0 + 1e-6
    whole_ramp = h == pytest.approx(leg.up.duration / 2)
    assert whole_ramp or max(apart / 2, speed / 8) == pytest.approx(1, abs=1e-6)
    tight = half_overlap(leg, u, leg, w, replace(bounds, radius=0.5))
    assert tight <= h
