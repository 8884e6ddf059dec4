"""The feasible set and the flights to start from."""

from itertools import product
from typing import Any

import numpy as np
import pytest
from conftest import MakePlan
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.errors import InfeasibleError, PlanError
from faao_mav.optimizer.kinematics import Kinematics, Trajectory, kinematics
from faao_mav.optimizer.search.straight import straight_flight


def make(**changes: Any) -> Kinematics:
    values: dict[str, Any] = {
        "start": np.array([0.0, 50.0]),
        "end": np.array([50.0, 0.0]),
        "slots": 21,
        "time_step": 0.5,
        "max_speed": 20.0,
        "max_acceleration": 5.0,
        "start_velocity": np.zeros(2),
        "end_velocity": np.zeros(2),
        "bound_first_acceleration": True,
    }
    return Kinematics(**(values | changes))


def worst(kin: Kinematics, flight: Trajectory) -> float:
    return max(kin.residuals(flight).values())


ENDS = [(None, None), ([0, 0], None), ([3, -3], [5, -5]), ([0, 6], [4, 1]), ([-5, 5], None)]


@pytest.mark.parametrize(("first", "last"), ENDS)
def test_the_start_is_feasible(first: Any, last: Any) -> None:
    ends = [None if v is None else np.array(v, dtype=float) for v in (first, last)]
    for bounded, end in product((True, False), ([50.0, 0.0], [0.0, 50.0])):
        kin = make(
            start_velocity=ends[0],
            end_velocity=ends[1],
            bound_first_acceleration=bounded,
            end=np.array(end),
        )
        flight = straight_flight(kin)
        assert flight.w.shape == flight.v.shape == flight.a.shape == (21, 2)
        assert worst(kin, flight) < 1e-7


def test_hover_to_hover_is_straight_and_even() -> None:
    flight = straight_flight(make())
    assert flight.w @ np.array([1.0, 1.0]) == pytest.approx(50)
    speed = np.linalg.norm(flight.v, axis=1)
    assert speed == pytest.approx(speed[::-1], abs=1e-9)
    assert speed[0] == 0
    # 10 s of which two ramps at 5 m/s²: 70.7 m = v (10 - v / 5), up to the discretisation
    assert speed.max() == pytest.approx(8.5, abs=0.1)


def test_an_end_velocity_that_cannot_be_met_is_infeasible() -> None:
    kin = make(start_velocity=np.array([20.0, 0.0]), end_velocity=np.zeros(2), slots=5)
    with pytest.raises(InfeasibleError, match="end velocities"):
        straight_flight(kin)


@given(st.floats(0.05, 1), st.floats(0, 1), st.integers(3, 60), st.booleans(), st.integers(0, 2))
def test_plans_that_are_accepted_can_be_flown(
    small_plan: MakePlan, step: float, share: float, slots: int, bounded: bool, ends: int
) -> None:
    """The closed form of the reader and the start agree on what is possible."""
    step = round(step, 2)
    duration = round(step * slots, 6)
    distance = share * 20 * duration
    kinds = [("hover", "hover"), ("hover", "free"), ("free", "hover")][ends]
    try:
        plan = small_plan(
            {
                "flight.time_step": step,
                "flight.duration": duration,
                "flight.start": [0, 0],
                "flight.end": [distance, 0],
                "flight.start_velocity": kinds[0],
                "flight.end_velocity": kinds[1],
                "flight.bound_first_acceleration": bounded,
            }
        )
    except PlanError as error:
        assert "too short" in str(error)
        return
    kin = kinematics(plan)
    assert worst(kin, straight_flight(kin)) < 1e-6


def test_residuals_see_every_violation() -> None:
    kin = make()
    flight = straight_flight(kin)
    w, v, a = flight.w.copy(), flight.v.copy(), flight.a.copy()
    w[5] += 1
    v[7] += [30, 0]
    a[3] += [9, 0]
    v[0] += 0.5
    v[-1] += 0.25
    w[-1] += 2
    found = kin.residuals(Trajectory(w, v, a))
    assert found["(11) position"] > 1
    assert found["(12) velocity"] > 20
    assert found["(13d) ends"] == pytest.approx(2)
    assert found["(13e) speed"] > 10
    assert found["(13f) acceleration"] > 3
    assert found["start velocity"] == pytest.approx(0.5)
    assert found["end velocity"] == pytest.approx(0.25)


def test_the_first_acceleration_is_bounded_only_where_asked() -> None:
    kin = make(bound_first_acceleration=False)
    flight = straight_flight(kin)
    assert np.linalg.norm(flight.a[0]) > kin.max_acceleration
    assert worst(kin, flight) < 1e-9
    assert worst(make(), flight) > 1
