"""From a trajectory to the mission whose predicted flight keeps it, in space and time."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from relay_flights import (
    Trajectory,
    converted,
    dash,
    dash_hover_dash,
    items_of,
    plan_with,
)

from faao_mav.arrays import Real
from faao_mav.autopilot.predict import predict
from faao_mav.mission import Command
from faao_mav.schedule import Conversion

STEP = 0.2


def eight() -> Trajectory:
    """A figure of eight 120 m wide at 5 m/s or so, from rest to rest."""
    t = np.arange(0.0, 100.0, STEP)
    phase = 2 * np.pi * dash(0.0, 1.0, 1 / 80, 1 / 800, t)
    return t, np.stack([60 * np.sin(phase), 30 * np.sin(2 * phase)], axis=-1)


def back_and_forth() -> Trajectory:
    t = np.arange(0.0, 75.0, STEP)
    out = dash(0.0, 200.0, 8.0, 1.5, t)
    back = dash(0.0, 200.0, 8.0, 1.5, np.maximum(t - 36.0, 0.0))
    return t, np.outer(out - back, [0.6, 0.8])


def with_long_ends() -> Trajectory:
    t = np.arange(0.0, 80.0, STEP)
    return t, np.outer(dash(0.0, 150.0, 6.0, 1.0, np.maximum(t - 25.0, 0.0)), [0.0, 1.0])


def circle_at_speed() -> Trajectory:
    t = np.arange(0.0, 31.5, STEP)
    return t, 60 * np.stack([np.cos(t / 10), np.sin(t / 10)], axis=1)


def line_at_speed() -> Trajectory:
    t = np.arange(0.0, 20.0, STEP)
    return t, np.outer(6 * t, [1.0, 0.0])


def at(conversion: Conversion, t: float) -> list[Real]:
    """The predicted position and velocity at the plan's time `t`."""
    track = conversion.schedule.track()
    return [
        np.array([np.interp(t, track["predicted_t"], x) for x in track[name].T])
        for name in ("predicted_w", "predicted_v")
    ]


@pytest.mark.parametrize("flight", [dash_hover_dash, eight, back_and_forth, with_long_ends])
@pytest.mark.parametrize("recommend", [True, False])
def test_arducopter_keeps_the_plan_in_space_and_time(
    flight: Callable[[], Trajectory], recommend: bool
) -> None:
    t, w = flight()
    own = {"WPNAV_ACCEL": 120.0, "RTL_ALT": 4000.0}
    plan = plan_with(recommend=recommend, parameters=own if recommend else {})
    conversion = converted(t, w, plan)
    found = conversion.schedule.deviation
    assert found.rms < (1 if recommend else 3)
    assert found.path < plan.mission.path_tolerance
    assert abs(found.late) < 0.5
    assert len(conversion.mission.items) < 75
    told = conversion.parameters
    assert conversion.vehicle.parameters == {**plan.vehicle.parameters, **told}
    if recommend:  # by the names of both generations, beside the vehicle's own
        assert (told["WPNAV_SPEED"], told["WP_SPD"], "RTL_ALT" in told) == (800, 8, False)
        assert told["WPNAV_ACCEL"] == pytest.approx(100 * told["WP_ACC"])
        assert told["WPNAV_JERK"] == told["WP_JERK"]
        assert told["WP_ACC"] > 1.5  # the plan's own limit is not enough for a ramp with jerk
    else:
        assert not told


def test_px4_keeps_the_plan_in_space_and_time() -> None:
    t, w = dash_hover_dash(hover=10.0)
    plan = plan_with(autopilot="px4", recommend=True)
    conversion = converted(t, w, plan)
    found = conversion.schedule.deviation
    assert found.rms < 2
    assert found.path < plan.mission.path_tolerance
    assert abs(found.late) < 0.6
    assert len(conversion.mission.items) < 60
    assert conversion.parameters["MPC_XY_CRUISE"] == 8.0
    assert not any(name.startswith("WP") for name in conversion.parameters)


@pytest.mark.parametrize("flight", [circle_at_speed, line_at_speed])
def test_a_plan_that_begins_and_ends_at_speed_gets_a_run_in(
    flight: Callable[[], Trajectory],
) -> None:
    t, w = flight()
    conversion = converted(t, w, plan_with(recommend=True))
    route = conversion.schedule.route
    assert (route.first, route.last) == (1, len(route.positions) - 2)
    assert route.positions[[route.first, route.last]] == pytest.approx(w[[0, -1]], abs=1e-3)
    for n, planned in ((0, (w[1] - w[0]) / STEP), (-1, (w[-1] - w[-2]) / STEP)):
        place, velocity = at(conversion, t[n])
        assert np.hypot(*velocity) == pytest.approx(np.hypot(*planned), abs=0.5)
        assert place == pytest.approx(w[n], abs=1.2)
    assert conversion.schedule.deviation.rms < 1.2
    assert route.distance == pytest.approx(np.hypot(*np.diff(w, axis=0).T).sum(), rel=0.02)
    assert route.waits[route.first] == route.waits[route.last] == 0


@pytest.mark.parametrize("flight", [dash_hover_dash, eight, circle_at_speed])
def test_the_whole_mission_flies_the_schedule(flight: Callable[[], Trajectory]) -> None:
    """What is predicted of the items is what the schedule says of its route, as it is sent."""
    t, w = flight()
    plan = plan_with(recommend=True)
    conversion = converted(t, w, plan)
    route, flown = conversion.schedule.route, conversion.schedule.flown
    positions, speeds, waits = items_of(conversion.mission, plan)
    assert positions == pytest.approx(route.positions, abs=1e-3)
    assert speeds == list(route.speeds) == np.round(speeds, 3).tolist()
    assert waits[1:] == pytest.approx(route.waits[1:])
    assert (route.waits == np.round(route.waits, 3)).all()
    assert 0 < route.speeds.min() <= route.speeds.max() <= 1.1 * plan.vehicle.max_speed
    whole = predict(conversion.mission, conversion.vehicle, plan.origin.frame)
    items = conversion.mission.items
    waypoints = [  # or the delay at each, which ends later
        index + (items[index + 1].command == Command.NAV_DELAY)
        for index, item in enumerate(items)
        if item.command == Command.NAV_WAYPOINT
    ]
    assert not any(math.isnan(whole.reached[index]) for index in waypoints)
    passed = whole.reached[waypoints]
    assert np.diff(passed[:-1]) == pytest.approx(np.diff(flown.departures[:-1]), abs=0.25)
    start = passed[route.first] - (flown.departures[route.first] - conversion.schedule.start)
    planned = np.stack([np.interp(t + start, whole.t, x) for x in whole.position.T[:2]], axis=-1)
    apart = np.hypot(*(planned - conversion.schedule.positions(t)).T)
    assert apart.max() < 2.0  # 0.2 s: the mission leaves w_I from a hold, the schedule from rest


def test_a_flight_that_stays_is_one_hold_and_two_samples_are_enough() -> None:
    t, plan = np.arange(0.0, 60.0, STEP), plan_with(recommend=True)
    conversion = converted(t, np.full((len(t), 2), 12.5), plan)
    assert conversion.schedule.deviation.rms == pytest.approx(0, abs=1e-9)
    assert items_of(conversion.mission, plan)[2] == [pytest.approx(60, abs=2)]
    for end in ([0.0, 0.0], [0.3, 0.0], [30.0, 0.0]):
        conversion = converted(np.array([0.0, 10.0]), np.array([[0.0, 0.0], end]), plan)
        assert math.isfinite(conversion.schedule.deviation.rms)


@pytest.mark.parametrize(
    ("autopilot", "flight"), [("ardupilot", circle_at_speed), ("px4", back_and_forth)]
)
def test_noise_of_rounding_makes_no_other_mission(
    autopilot: str, flight: Callable[[], Trajectory]
) -> None:
    """Another processor's optimum differs in the last digits, and so do its predicted flights."""
    t, w = flight()
    plan = plan_with(autopilot=autopilot)
    noise = 1e-9 * np.random.default_rng(0).normal(size=w.shape)
    assert converted(t, w + noise, plan).mission == converted(t, w, plan).mission
