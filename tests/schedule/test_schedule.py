"""From a trajectory to the mission whose predicted flight keeps it, in space and time."""

import math
from functools import cache

import numpy as np
import pytest
from relay_flights import Trajectory, converted, dash, dash_hover_dash, items_of, plan_with

from faao_mav.autopilot.predict import predict
from faao_mav.mission import Command
from faao_mav.plan import Plan
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


FLIGHTS = {
    "dashes": dash_hover_dash,
    "px4 dashes": lambda: dash_hover_dash(hover=10.0),
    "eight": eight,
    "keep back and forth": back_and_forth,
    "keep long ends": with_long_ends,
    "circle": circle_at_speed,
}


@cache
def made(name: str) -> tuple[Trajectory, Plan, Conversion]:
    """Return the flight, the plan and the conversion of a case; `keep` its vehicle's parameters."""
    keep = name.startswith("keep")
    plan = plan_with(
        autopilot="px4" if name.startswith("px4") else "ardupilot",
        recommend=not keep,
        parameters={} if keep else {"WPNAV_ACCEL": 120.0, "RTL_ALT": 4000.0},
    )
    t, w = FLIGHTS[name]()
    return (t, w), plan, converted(t, w, plan)


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_plan_is_kept_in_space_and_time(name: str) -> None:
    _, plan, conversion = made(name)
    found, told = conversion.schedule.deviation, conversion.parameters
    assert found.rms < (3 if "keep" in name else 2 if "px4" in name else 1.2)
    assert found.path < plan.mission.path_tolerance
    assert abs(found.late) < (0.6 if "px4" in name else 0.5)
    assert len(conversion.mission.items) < 75
    assert conversion.vehicle.parameters == {**plan.vehicle.parameters, **told}
    if "keep" in name:
        assert not told
    elif "px4" in name:
        assert told["MPC_XY_CRUISE"] == 8.0
        assert not any(each.startswith("WP") for each in told)
    else:  # by the names of both generations, beside the vehicle's own
        assert (told["WPNAV_SPEED"], told["WP_SPD"], "RTL_ALT" in told) == (800, 8, False)
        assert told["WPNAV_ACCEL"] == pytest.approx(100 * told["WP_ACC"])
        assert told["WPNAV_JERK"] == told["WP_JERK"]
        assert told["WP_ACC"] > 1.5  # the plan's own limit is not enough for a ramp with jerk


def test_a_plan_that_begins_and_ends_at_speed_gets_a_run_in() -> None:
    (t, w), _, conversion = made("circle")
    route, flown = conversion.schedule.route, conversion.schedule.track()
    assert (route.first, route.last) == (1, len(route.positions) - 2)
    assert route.positions[[route.first, route.last]] == pytest.approx(w[[0, -1]], abs=1e-3)
    for n, planned in ((0, (w[1] - w[0]) / STEP), (-1, (w[-1] - w[-2]) / STEP)):
        place, velocity = (
            [np.interp(t[n], flown["predicted_t"], x) for x in flown[which].T]
            for which in ("predicted_w", "predicted_v")
        )
        assert np.hypot(*velocity) == pytest.approx(np.hypot(*planned), abs=0.5)
        assert place == pytest.approx(w[n], abs=1.2)
    assert route.distance == pytest.approx(np.hypot(*np.diff(w, axis=0).T).sum(), rel=0.02)
    assert route.waits[route.first] == route.waits[route.last] == 0


@pytest.mark.parametrize("name", ["dashes", "eight", "circle"])
def test_the_whole_mission_flies_the_schedule(name: str) -> None:
    """What is predicted of the items is what the schedule says of its route, as it is sent."""
    (t, _), plan, conversion = made(name)
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


@pytest.mark.parametrize("name", ["circle", "px4 dashes"])
def test_noise_of_rounding_makes_no_other_mission(name: str) -> None:
    """Another processor's optimum differs in the last digits, and so do its predicted flights."""
    (t, w), plan, conversion = made(name)
    noise = 1e-9 * np.random.default_rng(0).normal(size=w.shape)
    assert converted(t, w + noise, plan).mission == conversion.mission
