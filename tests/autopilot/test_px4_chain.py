"""The parts of the PX4 model: ramps within limits, and the aircraft's response to them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from faao_mav.arrays import Real
from faao_mav.autopilot.body import PX4_BODY
from faao_mav.autopilot.px4 import response
from faao_mav.autopilot.px4.smoothing import follow, soon_there

JERK = 4.0
LIMIT = 3.0

axes = st.lists(
    st.tuples(st.floats(-9, 9), st.floats(-LIMIT, LIMIT), st.floats(-9, 9), st.just(LIMIT)),
    min_size=1,
    max_size=3,
)
steps = st.floats(0.01, 0.1)


@given(axes, steps)
def test_ramps_stay_within_limits(axes: list[tuple[float, float, float, float]], dt: float) -> None:
    for (velocity, acceleration, _, _), (after, onward) in zip(
        axes, follow(axes, JERK, dt), strict=True
    ):
        assert abs(onward) <= LIMIT + 1e-9
        assert abs(onward - acceleration) <= JERK * dt + 1e-9
        # Between what the greatest and the least jerk make of it.
        assert abs(after - velocity - acceleration * dt) <= JERK * dt * dt / 2 + 1e-9


@given(axes)
def test_ramps_end_together_at_what_was_asked_for(
    axes: list[tuple[float, float, float, float]],
) -> None:
    wanted = [axis[2] for axis in axes]
    for _ in range(200):
        axes = [
            (*moved, *axis[2:]) for axis, moved in zip(axes, follow(axes, JERK, 0.1), strict=True)
        ]
    np.testing.assert_allclose([axis[0] for axis in axes], wanted, atol=1e-6)
    np.testing.assert_allclose([axis[1] for axis in axes], 0, atol=1e-6)


def test_one_axis_takes_the_shortest_time() -> None:
    # From rest to 4 m/s: 0.75 s of rising, 0.583 s at the limit, 0.75 s of falling acceleration.
    whole = 2 * LIMIT / JERK + (4 - LIMIT * LIMIT / JERK) / LIMIT
    early, onward = follow([(0.0, 0.0, 4.0, LIMIT)], JERK, whole - 0.01)[0]
    assert 0 < 4 - early < 1e-3
    assert onward == pytest.approx(0.01 * JERK)
    assert follow([(0.0, 0.0, 4.0, LIMIT)], JERK, whole)[0] == pytest.approx((4, 0))


@given(st.floats(0, 0.999), st.floats(0, 7), st.floats(-0.999, 0.999), steps)
def test_what_is_soon_there_is_there(share: float, angle: float, push: float, dt: float) -> None:
    error = share * JERK * dt * dt / 16 * np.exp(1j * angle)
    acceleration = push * JERK * dt / 8
    assert soon_there(abs(error), abs(acceleration), JERK, dt)
    axes = [(5.0, acceleration, 5 + error.real, LIMIT), (1.0, 0.0, 1 + error.imag, LIMIT)]
    for axis, moved in zip(axes, follow(axes, JERK, dt), strict=True):
        assert moved == pytest.approx((axis[2], 0))


@given(
    st.tuples(*[st.floats(-5, 5)] * 7),
    st.floats(-1, 1),
    st.floats(-5, 5),
    st.floats(-5, 5),
    st.floats(0.01, 0.4),
    st.sampled_from([0.05, PX4_BODY.lag, 1.0]),
    st.floats(0, 2),
)
def test_response_solves_the_equations_of_motion(
    motion: response.Motion[float],
    shift: float,
    velocity: float,
    acceleration: float,
    dt: float,
    lag: float,
    drag: float,
) -> None:
    began, change = np.array(motion[4:]), np.array([shift, velocity, acceleration])
    change[1:] -= began[1:]
    proportional, integral, derivative = response.VELOCITY_GAINS

    def rates(t: float, own: Real) -> Real:
        place, wanted, feed = began + change * (t / dt)
        position, speed, thrust, integrated = own
        error = wanted + response.POSITION_GAIN * (place - position) - speed
        pull = thrust - drag * speed
        demand = feed + proportional * error + integrated - derivative * pull
        return np.array([speed, pull, (demand - thrust) / lag, integral * error])

    solved = solve_ivp(rates, (0, dt), motion[:4], rtol=1e-10, atol=1e-10).y[:, -1]
    step = response.step_of(dt, lag, drag)
    after = response.advance(step, motion, shift, velocity, acceleration)
    np.testing.assert_allclose(after[:4], solved, atol=1e-5)
    np.testing.assert_allclose(after[4:], [began[0] + shift, velocity, acceleration])
