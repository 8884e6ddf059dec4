"""Speeds and holds are found from the flight that they make."""

from dataclasses import replace
from functools import partial
from typing import TypeAlias

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.arrays import Real
from faao_mav.autopilot import Flown
from faao_mav.autopilot.ardupilot.copter import ArduCopter
from faao_mav.errors import InputError
from faao_mav.schedule.route import Route
from faao_mav.schedule.schedule import Schedule, lateness
from faao_mav.schedule.timing import MOST_LEAD, SHORTEST_HOLD, fit

MODEL = ArduCopter(acceleration=4, jerk=10)
PLACES = np.array([[0.0, 0.0, 0.0], [120, 0, 0], [240, 60, 0], [240, 200, 0], [100, 200, 0]])
SPEEDS = np.array([7.0, 4.0, 6.0, 3.0])
WAITS = np.array([0.0, 0.0, 12.4, 0.0, 3.0])


def route_with(speeds: Real, waits: Real) -> Route:
    count = len(waits)
    return Route(
        positions=PLACES[:count, :2],
        arrivals=np.zeros(count),
        departures=np.zeros(count),
        speeds=speeds,
        waits=waits,
        radii=np.zeros(count),
        first=0,
        last=count - 1,
    )


def flown(route: Route) -> Flown:
    return MODEL.fly(route.path(whole_seconds=True))


Plan: TypeAlias = tuple[Real, Real, float]
"""Times, s, and positions, m, of a plan, and the path tolerance, m."""


def plan_of(route: Route, *, ahead: float = 0.0) -> Plan:
    """The flight of `route` as a plan whose clock starts `ahead` seconds into it."""
    flight = flown(route)
    t = np.arange(0.0, flight.departures[-1] - ahead, 0.2)
    w = np.stack([np.interp(t + ahead, flight.t, x) for x in flight.position.T[:2]], axis=-1)
    return t, w, 2.0


def fitted(
    plan: Plan,
    begin: Route,
    *,
    groups: list[int] | None = None,
    min_speed: float = 0.1,
    max_speed: float = 8.0,
) -> Schedule:
    return fit(
        lambda route: Schedule(route, flown(route), *plan),
        begin,
        groups=np.array(groups if groups is not None else range(len(begin.speeds))),
        free=(begin.waits > 0) & (np.arange(len(begin.waits)) != len(begin.waits) - 1),
        min_speed=min_speed,
        max_speed=max_speed,
    )


def test_the_speeds_and_holds_that_made_a_flight_are_found() -> None:
    plan = plan_of(route_with(SPEEDS, WAITS))
    found = fitted(plan, route_with(np.full(4, 5.0), np.where(WAITS > 5, 8.0, WAITS)))
    assert found.route.speeds == pytest.approx(SPEEDS, abs=0.1)
    assert found.route.waits == pytest.approx(WAITS, abs=0.5)
    assert found.route.lead == pytest.approx(0, abs=0.1)
    assert found.deviation.max < 0.5


@settings(max_examples=15)
@given(
    st.lists(st.floats(2.5, 8), min_size=4, max_size=4),
    st.floats(3, 20),
    st.lists(st.floats(3, 7), min_size=4, max_size=4),
)
def test_a_flight_is_found_from_any_beginning(
    made: list[float], hold: float, begin: list[float]
) -> None:
    waits = np.array([0.0, 0.0, hold, 0.0, 3.0])
    plan = plan_of(route_with(np.array(made), waits))
    guess = route_with(np.array(begin), np.array([0.0, 0.0, 8.0, 0.0, 3.0]))
    before = Schedule(guess, flown(guess), *plan).deviation.rms
    assert fitted(plan, guess).deviation.rms < max(0.6, 0.1 * before)


def test_a_flight_without_an_end_is_not_the_one_that_fits() -> None:
    plan = plan_of(route_with(SPEEDS, WAITS))
    begin = route_with(np.full(4, 5.0), np.where(WAITS > 5, 8.0, WAITS))

    def flight(route: Route) -> Schedule:
        if not np.allclose(route.speeds, begin.speeds):
            raise InputError("the flight would take more than 21600 s")
        return Schedule(route, flown(route), *plan)

    found = fit(
        flight,
        begin,
        groups=np.arange(4),
        free=np.zeros(5, dtype=bool),
        min_speed=0.1,
        max_speed=8.0,
    )
    assert found.route.speeds == pytest.approx(begin.speeds)


def test_a_fit_takes_few_flights() -> None:
    plan = plan_of(route_with(SPEEDS, WAITS))
    flights = []

    def flight(route: Route) -> Schedule:
        flights.append(route)
        return Schedule(route, flown(route), *plan)

    begin = route_with(np.full(4, 5.0), np.where(WAITS > 5, 8.0, WAITS))
    fitting = partial(
        fit, flight, begin, groups=np.arange(4), free=WAITS > 5, min_speed=0.1, max_speed=8.0
    )
    found = fitting()
    assert len(flights) <= 6
    assert found.deviation.rms < 0.5
    flights.clear()
    rough = fitting(flights=2)
    assert len(flights) == 2
    assert rough.deviation.rms < 0.3 * Schedule(begin, flown(begin), *plan).deviation.rms


def test_setting_out_before_the_plan_is_found() -> None:
    begin = route_with(SPEEDS, WAITS)
    found = fitted(plan_of(begin, ahead=0.8), begin).route
    assert found.lead == pytest.approx(0.8, abs=0.1)
    assert found.speeds == pytest.approx(SPEEDS, abs=0.1)
    assert found.waits == pytest.approx(WAITS, abs=0.2)
    assert fitted(plan_of(begin, ahead=9.0), begin).route.lead <= MOST_LEAD


@given(st.floats(0.3, 30.0))
def test_a_flight_is_not_over_where_it_passes_its_end_on_the_way(slowness: float) -> None:
    """There and back through the end, and round after round: at any speed it is the same way."""
    t = np.linspace(0.0, 240.0, 241)
    there_and_back = np.interp(t, [0, 160, 240], [-500.0, 700.0, 0.0])
    angle = 2 * np.pi * 3 * t / 240
    for w in (
        np.column_stack([there_and_back, 0 * t]),
        50 * np.column_stack([np.cos(angle), np.sin(angle)]),
    ):
        late = lateness(t, w, slowness * t, w, 2.0)
        assert late == pytest.approx((slowness - 1) * 240, rel=0.02, abs=0.5)


def test_how_late_a_flight_is_over() -> None:
    route = route_with(SPEEDS, WAITS)
    plan, flight = plan_of(route), flown(route)
    assert Schedule(route, flight, *plan).late == pytest.approx(0, abs=0.01)
    assert Schedule(replace(route, lead=0.7), flight, *plan).late == pytest.approx(-0.7, abs=0.01)
    longer = flown(route_with(SPEEDS, WAITS + np.array([0, 0, 3, 0, 0])))
    assert Schedule(route, longer, *plan).late == pytest.approx(3, abs=0.05)


def test_a_flight_that_begins_at_speed_has_no_lead() -> None:
    plain = route_with(SPEEDS, WAITS)
    route = replace(plain, first=1, arrivals=flown(plain).arrivals - 0.8)
    assert fitted(plan_of(route, ahead=0.8), route).route.lead == 0


def test_legs_of_one_group_share_a_speed() -> None:
    begin = route_with(SPEEDS, WAITS)
    speeds = fitted(plan_of(begin), begin, groups=[0, 0, 1, 1]).route.speeds
    assert speeds[0] == speeds[1] != speeds[2] == speeds[3]
    assert 4 < speeds[0] < 7


def test_bounds_are_kept() -> None:
    plan = plan_of(route_with(SPEEDS, WAITS))
    begin = route_with(np.full(4, 5.0), WAITS)
    speeds = fitted(plan, begin, min_speed=3.5, max_speed=5.5).route.speeds
    assert speeds.min() >= 3.5
    assert speeds.max() <= 5.5
    assert speeds[[0, 3]] == pytest.approx([5.5, 3.5])


def test_a_hold_stays_one() -> None:
    passing = plan_of(route_with(SPEEDS, np.zeros(5)))
    waits = fitted(passing, route_with(SPEEDS, WAITS)).route.waits
    assert waits[2] >= SHORTEST_HOLD
    assert waits[2] == pytest.approx(SHORTEST_HOLD, abs=0.3)
    assert waits[[0, 1, 3, 4]] == pytest.approx(WAITS[[0, 1, 3, 4]])


def test_one_point_has_nothing_to_fit() -> None:
    route = route_with(np.zeros(0), np.array([7.0]))
    found = fitted((np.arange(5.0), np.zeros((5, 2)), 2.0), route)
    assert (len(found.route.speeds), found.route.waits.tolist(), found.route.lead) == (0, [7], 0)
