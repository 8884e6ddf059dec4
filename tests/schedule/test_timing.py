"""Speeds and holds are found from the flight that they make."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.arrays import Real
from faao_mav.schedule.schedule import Clock
from faao_mav.schedule.timing import MOST_LEAD, SHORTEST_HOLD, fit
from faao_mav.vehicle import FlightPath
from faao_mav.vehicle.ardupilot.copter import ArduCopter

MODEL = ArduCopter(acceleration=4, jerk=10)
PLACES = np.array([[0.0, 0.0, 0.0], [120, 0, 0], [240, 60, 0], [240, 200, 0], [100, 200, 0]])
SPEEDS = np.array([7.0, 4.0, 6.0, 3.0])
WAITS = np.array([0.0, 0.0, 12.4, 0.0, 3.0])


def path_with(speeds: Real, waits: Real) -> FlightPath:
    count = len(waits)
    holds = np.floor(waits)
    return FlightPath(
        points=PLACES[:count],
        speeds=speeds,
        holds=holds,
        splines=np.zeros(count, dtype=bool),
        radii=np.zeros(count),
        delays=waits - holds,
    )


def plan_of(path: FlightPath, *, ahead: float = 0.0) -> Clock:
    """The flight of `path` as a plan whose clock starts `ahead` seconds into it."""
    flown = MODEL.fly(path)
    t = np.arange(0.0, flown.departures[-1] - ahead, 0.2)
    w = np.stack([np.interp(t + ahead, flown.t, x) for x in flown.position.T[:2]], axis=-1)
    return Clock(t=t, w=w, waypoint=0, at=0.0, leaving=True, tolerance=2.0)


def fitted(
    clock: Clock,
    begin: FlightPath,
    *,
    groups: list[int] | None = None,
    min_speed: float = 0.1,
    max_speed: float = 8.0,
) -> tuple[Real, Real, float]:
    return fit(
        MODEL,
        begin,
        clock,
        groups=np.array(groups if groups is not None else range(len(begin.speeds))),
        free=(begin.holds > 0) & (np.arange(len(begin.holds)) != len(begin.holds) - 1),
        min_speed=min_speed,
        max_speed=max_speed,
    )


def test_the_speeds_and_holds_that_made_a_flight_are_found() -> None:
    clock = plan_of(path_with(SPEEDS, WAITS))
    begin = path_with(np.full(4, 5.0), np.where(WAITS > 5, 8.0, WAITS))
    speeds, waits, lead = fitted(clock, begin)
    assert speeds == pytest.approx(SPEEDS, abs=0.1)
    assert waits == pytest.approx(WAITS, abs=0.5)
    assert lead == pytest.approx(0, abs=0.1)
    flown = MODEL.fly(path_with(speeds, waits))
    assert np.hypot(*(clock.positions(flown, clock.t) - clock.w).T).max() < 0.5


def apart(clock: Clock, speeds: Real, waits: Real) -> float:
    """How far the flight is from the plan at equal times, m rms."""
    flown = MODEL.fly(path_with(speeds, waits))
    away = (clock.positions(flown, clock.t) - clock.w) ** 2
    return float(np.sqrt(away.sum(axis=1).mean()))


@settings(max_examples=15)
@given(
    st.lists(st.floats(2.5, 8), min_size=4, max_size=4),
    st.floats(3, 20),
    st.lists(st.floats(3, 7), min_size=4, max_size=4),
)
def test_a_flight_is_found_from_any_beginning(
    made: list[float], hold: float, begin: list[float]
) -> None:
    """A local method: of 60 random cases it ended below 0.6 m in 56, the others 1 to 3 m off."""
    waits = np.array([0.0, 0.0, hold, 0.0, 3.0])
    clock = plan_of(path_with(np.array(made), waits))
    guess = path_with(np.array(begin), np.array([0.0, 0.0, 8.0, 0.0, 3.0]))
    speeds, held, lead = fitted(clock, guess)
    before = apart(clock, guess.speeds, guess.holds + guess.delays)
    assert apart(replace(clock, lead=lead), speeds, held) < max(0.6, 0.1 * before)


def test_setting_out_before_the_plan_is_found() -> None:
    clock = plan_of(path_with(SPEEDS, WAITS), ahead=0.8)
    speeds, waits, lead = fitted(clock, path_with(SPEEDS, WAITS))
    assert lead == pytest.approx(0.8, abs=0.1)
    assert speeds == pytest.approx(SPEEDS, abs=0.1)
    assert waits == pytest.approx(WAITS, abs=0.2)
    far = plan_of(path_with(SPEEDS, WAITS), ahead=9.0)
    assert fitted(far, path_with(SPEEDS, WAITS))[2] <= MOST_LEAD


def test_how_late_a_flight_is_over() -> None:
    path = path_with(SPEEDS, WAITS)
    clock, flown = plan_of(path), MODEL.fly(path)
    assert clock.late(flown) == pytest.approx(0, abs=0.01)
    assert replace(clock, lead=0.7).late(flown) == pytest.approx(-0.7, abs=0.01)
    longer = MODEL.fly(path_with(SPEEDS, WAITS + np.array([0, 0, 3, 0, 0])))
    assert clock.late(longer) == pytest.approx(3, abs=0.05)


def test_a_flight_that_begins_at_speed_has_no_lead() -> None:
    path = path_with(SPEEDS, WAITS)
    flown = MODEL.fly(path)
    clock = plan_of(path, ahead=0.8)
    passing = replace(clock, waypoint=1, at=float(flown.arrivals[1]) - 0.8, leaving=False)
    assert fitted(passing, path)[2] == 0


def test_legs_of_one_group_share_a_speed() -> None:
    clock = plan_of(path_with(SPEEDS, WAITS))
    speeds, _, _ = fitted(clock, path_with(SPEEDS, WAITS), groups=[0, 0, 1, 1])
    assert speeds[0] == speeds[1] != speeds[2] == speeds[3]
    assert 4 < speeds[0] < 7


def test_bounds_are_kept() -> None:
    clock = plan_of(path_with(SPEEDS, WAITS))
    begin = path_with(np.full(4, 5.0), WAITS)
    speeds, _, _ = fitted(clock, begin, min_speed=3.5, max_speed=5.5)
    assert speeds.min() >= 3.5
    assert speeds.max() <= 5.5
    assert speeds[[0, 3]] == pytest.approx([5.5, 3.5])


def test_a_hold_stays_one() -> None:
    passing = plan_of(path_with(SPEEDS, np.zeros(5)))
    _, waits, _ = fitted(passing, path_with(SPEEDS, WAITS))
    assert waits[2] >= SHORTEST_HOLD
    assert waits[2] == pytest.approx(SHORTEST_HOLD, abs=0.3)
    assert waits[[0, 1, 3, 4]] == pytest.approx(WAITS[[0, 1, 3, 4]])


def test_one_point_has_nothing_to_fit() -> None:
    path = path_with(np.zeros(0), np.array([7.0]))
    speeds, waits, lead = fit(
        MODEL,
        path,
        Clock(np.arange(5.0), np.zeros((5, 2)), 0, 0.0, True, 2.0),
        groups=np.zeros(0, dtype=int),
        free=np.array([False]),
        min_speed=0.1,
        max_speed=8.0,
    )
    assert (len(speeds), waits.tolist(), lead) == (0, [7.0], 0.0)
