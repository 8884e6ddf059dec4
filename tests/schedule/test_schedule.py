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
    nearly_there,
    plan_with,
)

from faao_mav.arrays import Real
from faao_mav.autopilot.predict import predict
from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission import Command
from faao_mav.schedule import Conversion
from faao_mav.schedule.conversion import check_vehicle

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
    plan = plan_with(recommend=recommend)
    conversion = converted(t, w, plan)
    found = conversion.schedule.deviation
    assert found.rms < (1 if recommend else 3)
    assert found.path < plan.mission.path_tolerance
    assert nearly_there(conversion, w) == pytest.approx(0, abs=0.5)
    assert len(conversion.mission.items) < 70


def test_px4_keeps_the_plan_in_space_and_time() -> None:
    t, w = dash_hover_dash(hover=10.0)
    plan = plan_with(autopilot="px4", recommend=True)
    conversion = converted(t, w, plan)
    found = conversion.schedule.deviation
    assert found.rms < 2
    assert found.path < plan.mission.path_tolerance
    assert nearly_there(conversion, w) == pytest.approx(0, abs=0.6)
    assert len(conversion.mission.items) < 60
    assert conversion.parameters["MPC_XY_CRUISE"] == 8.0
    assert not any(name.startswith("WP") for name in conversion.parameters)
    assert not any(item.command == Command.NAV_DELAY for item in conversion.mission.items)


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


def test_recommended_parameters_have_the_names_of_both_generations() -> None:
    conversion = converted(*dash_hover_dash(), plan_with(recommend=True))
    found = conversion.parameters
    assert found["WPNAV_SPEED"] == 800
    assert found["WP_SPD"] == 8
    assert found["WPNAV_ACCEL"] == pytest.approx(100 * found["WP_ACC"])
    assert found["WPNAV_JERK"] == found["WP_JERK"]
    assert found["WP_ACC"] > 1.5  # the plan's own limit is not enough for a ramp with jerk
    assert conversion.vehicle.parameters == found
    route = conversion.schedule.route  # of a plan that speeds up from rest: without a run-in
    assert (route.first, route.last) == (0, len(route.positions) - 1)
    assert route.waits[0] == 6  # a hold of a second leaves the aircraft drifting


def test_recommended_parameters_stand_beside_those_of_the_vehicle_or_are_left_out() -> None:
    own = {"WPNAV_ACCEL": 120.0, "RTL_ALT": 4000.0}
    for recommend in (True, False):
        plan = plan_with(recommend=recommend, parameters=own)
        conversion = converted(*dash_hover_dash(), plan)
        assert "RTL_ALT" not in conversion.parameters
        assert bool(conversion.parameters) == recommend
        assert conversion.vehicle.parameters == {**own, **conversion.parameters}


def test_a_vehicle_that_is_slow_to_speed_up_is_later_than_one_with_good_parameters() -> None:
    sluggish = plan_with(parameters={"WPNAV_ACCEL": 50.0})
    good = plan_with(recommend=True)
    worse, better = (
        converted(*back_and_forth(), plan).schedule.deviation.rms for plan in (sluggish, good)
    )
    assert worse > 1.5 * better


def test_a_speed_that_no_mission_commands_is_refused_by_its_key() -> None:
    plan = plan_with(recommend=True).changed({"vehicle.max_speed": 0.05, "flight.end": [0, 350]})
    with pytest.raises(InputError, match=r"vehicle\.max_speed: 0\.05 m/s; missions command 0\.1"):
        check_vehicle(plan)


def test_useless_parameters_are_refused() -> None:
    with pytest.raises(InputError, match=r"vehicle\.parameters.*WPNAV_JERK: 0"):
        converted(*dash_hover_dash(), plan_with(parameters={"WPNAV_JERK": 0.0}))


@pytest.mark.parametrize("flight", [dash_hover_dash, circle_at_speed])
def test_values_are_what_is_sent(flight: Callable[[], Trajectory]) -> None:
    plan = plan_with(recommend=True)
    conversion = converted(*flight(), plan)
    route = conversion.schedule.route
    positions, speeds, waits = items_of(conversion.mission, plan)
    assert positions == pytest.approx(route.positions, abs=1e-3)
    assert speeds == list(route.speeds)
    assert waits[1:] == pytest.approx((route.waits)[1:])
    assert (route.waits == np.round(route.waits, 2)).all()
    assert np.round(route.speeds, 3) == pytest.approx(route.speeds, abs=1e-12)
    assert route.speeds.min() > 0
    assert route.speeds.max() <= 1.1 * plan.vehicle.max_speed


@pytest.mark.parametrize("flight", [dash_hover_dash, eight, circle_at_speed])
def test_the_whole_mission_flies_the_schedule(flight: Callable[[], Trajectory]) -> None:
    """What is predicted of the items is what the schedule says of its route."""
    t, w = flight()
    plan = plan_with(recommend=True)
    conversion = converted(t, w, plan)
    frame = LocalFrame(plan.origin.latitude, plan.origin.longitude)
    whole = predict(conversion.mission, conversion.vehicle, frame)
    items = conversion.mission.items
    waypoints = [  # or the delay at each, which ends later
        index + (items[index + 1].command == Command.NAV_DELAY)
        for index, item in enumerate(items)
        if item.command == Command.NAV_WAYPOINT
    ]
    assert not any(math.isnan(whole.reached[index]) for index in waypoints)
    route, flown = conversion.schedule.route, conversion.schedule.flown
    passed = whole.reached[waypoints]
    assert np.diff(passed[:-1]) == pytest.approx(np.diff(flown.departures[:-1]), abs=0.25)
    start = passed[route.first] - (flown.departures[route.first] - conversion.schedule.start)
    planned = np.stack([np.interp(t + start, whole.t, x) for x in whole.position.T[:2]], axis=-1)
    apart = np.hypot(*(planned - conversion.schedule.positions(t)).T)
    assert apart.max() < 2.0  # 0.2 s: the mission leaves w_I from a hold, the schedule from rest


def test_a_flight_that_stays_is_one_hold() -> None:
    t = np.arange(0.0, 60.0, STEP)
    conversion = converted(t, np.full((len(t), 2), 12.5), plan_with(recommend=True))
    assert conversion.schedule.deviation.rms == pytest.approx(0, abs=1e-9)
    _, _, waits = items_of(conversion.mission, plan_with())
    assert waits == [pytest.approx(60, abs=2)]


def test_two_samples_are_enough() -> None:
    for end in ([0.0, 0.0], [0.3, 0.0], [30.0, 0.0]):
        conversion = converted(
            np.array([0.0, 10.0]), np.array([[0.0, 0.0], end]), plan_with(recommend=True)
        )
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
