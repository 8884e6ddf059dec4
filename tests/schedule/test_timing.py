"""Speeds and holds are found from the flight that they make."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from faao_mav.arrays import Real
from faao_mav.autopilot import FlightPath, Flown, Vehicle
from faao_mav.autopilot.ardupilot.copter import ArduCopter
from faao_mav.errors import InputError
from faao_mav.schedule.prediction import Schedule
from faao_mav.schedule.route import Route
from faao_mav.schedule.scheduler import CopterScheduler
from faao_mav.schedule.timing import MOST_LEAD, SHORTEST_HOLD

VEHICLE = Vehicle("ardupilot", "copter", {"WPNAV_ACCEL": 400.0, "WPNAV_JERK": 10.0})
PLACES = np.array([[0.0, 0.0], [120, 0], [240, 60], [240, 200], [100, 200]])
SPEEDS = np.array([7.0, 4.0, 6.0, 3.0])
WAITS = np.array([0.0, 0.0, 12.4, 0.0, 3.0])


def route_with(speeds: Real, waits: Real) -> Route:
    still, last = np.zeros(len(waits)), len(waits) - 1
    return Route(PLACES[: len(waits)], still, still, speeds, waits, still, first=0, last=last)


def scheduler_for(t: Real, w: Real) -> CopterScheduler:
    return CopterScheduler(t, w, VEHICLE, VEHICLE.flight_model(), 0.1, 8.0, tolerance=2.0)


def planned(route: Route, *, ahead: float = 0.0) -> CopterScheduler:
    """The flight of `route` as a plan whose clock starts `ahead` seconds into it."""
    flight = scheduler_for(np.arange(2.0), np.zeros((2, 2))).flight(route).flown
    t = np.arange(0.0, flight.departures[-1] - ahead, 0.2)
    w = np.stack([np.interp(t + ahead, flight.t, x) for x in flight.position.T[:2]], axis=-1)
    return scheduler_for(t, w)


def fitted(scheduler: CopterScheduler, begin: Route, **options: Any) -> Schedule:
    return scheduler.fitted(begin, scheduler.max_speed, **options)


GUESS = route_with(np.full(4, 5.0), np.where(WAITS > 5, 8.0, WAITS))


def test_the_commands_that_made_a_flight_are_found_in_few_flights(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plan, fly, flights = planned(route_with(SPEEDS, WAITS)), ArduCopter.fly, []

    def counted(model: ArduCopter, path: FlightPath) -> Flown:
        flights.append(path)
        return fly(model, path)

    monkeypatch.setattr(ArduCopter, "fly", counted)
    found = fitted(plan, GUESS)
    assert found.route.speeds == pytest.approx(SPEEDS, abs=0.1)
    assert found.route.waits == pytest.approx(WAITS, abs=0.5)
    assert found.route.lead == pytest.approx(0, abs=0.1)
    assert found.deviation.max < 0.5
    assert len(flights) <= 6

    # a flight without an end is not the one that fits
    def followed(model: ArduCopter, path: FlightPath) -> Flown:
        if not np.allclose(path.speeds, GUESS.speeds):
            raise InputError("the flight would take more than 21600 s")
        return fly(model, path)

    monkeypatch.setattr(ArduCopter, "fly", followed)
    assert fitted(plan, GUESS).route.speeds == pytest.approx(GUESS.speeds)


def test_setting_out_before_the_plan_is_found() -> None:
    begin = route_with(SPEEDS, WAITS)
    found = fitted(planned(begin, ahead=0.8), begin).route
    assert found.lead == pytest.approx(0.8, abs=0.1)
    assert found.speeds == pytest.approx(SPEEDS, abs=0.1)
    assert fitted(planned(begin, ahead=9.0), begin).route.lead <= MOST_LEAD
    at_speed = replace(begin, first=1, arrivals=planned(begin).flight(begin).flown.arrivals - 0.8)
    assert fitted(planned(begin, ahead=0.8), at_speed).route.lead == 0


def test_groups_bounds_and_holds_are_kept() -> None:
    begin = route_with(SPEEDS, WAITS)
    speeds = fitted(planned(begin), begin, groups=np.array([0, 0, 1, 1])).route.speeds
    assert speeds[0] == speeds[1] != speeds[2] == speeds[3]
    narrow = replace(planned(begin), min_speed=3.5, max_speed=5.5)
    speeds = fitted(narrow, route_with(np.full(4, 5.0), WAITS)).route.speeds
    assert speeds[[0, 3]] == pytest.approx([5.5, 3.5])
    waits = fitted(planned(route_with(SPEEDS, np.zeros(5))), begin).route.waits
    assert waits[2] == pytest.approx(SHORTEST_HOLD, abs=0.3)
    assert waits[[0, 1, 3, 4]] == pytest.approx(WAITS[[0, 1, 3, 4]])
    alone = fitted(
        scheduler_for(np.arange(5.0), np.zeros((5, 2))), route_with(np.zeros(0), np.array([7.0]))
    )
    assert alone.route.waits.tolist() == [7]
