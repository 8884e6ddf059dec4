"""Whole missions, from take-off to their end, in the words of `judged.py`."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st
from judged import COPTER, FRAME, HOME, VEHICLES, at, do, given
from random_missions import missions

from faao_mav.arrays import Real
from faao_mav.autopilot import Track, Vehicle
from faao_mav.autopilot.body import PlaneBody
from faao_mav.autopilot.predict import predict
from faao_mav.errors import InputError
from faao_mav.mission import Command, Frame, Mission, MissionItem
from faao_mav.mission.item import JUMPS
from faao_mav.validate import Limits, ValidationContext, validate

PREDICTED = Path(__file__).parents[1] / "data" / "predicted.txt"


def flown(line: str) -> Track:
    case = given(line)
    track = predict(case.mission, case.vehicle, FRAME)
    check(case.mission, track)
    return track


def check(mission: Mission, track: Track, step: float = 0.1) -> None:
    """What holds of every track."""
    assert (np.diff(track.t) > 0).all()
    assert len(track.t) == len(track.position) == len(track.velocity) == len(track.item)
    assert np.isfinite(track.position).all()
    speeds = np.linalg.norm(track.velocity, axis=1)
    assert np.isfinite(speeds).all()
    steps = np.linalg.norm(np.diff(track.position, axis=0), axis=1)
    assert (steps <= 1.01 * speeds.max(initial=0) * np.diff(track.t) + 0.02).all()  # it never jumps
    assert len(track.reached) == len(mission.items)
    if len(track.t):
        assert track.t[0] >= 0
        assert 0 <= track.item.min() <= track.item.max() < max(len(mission.items), 1)
        known = track.reached[np.isfinite(track.reached)]
        assert (known >= 0).all()
        assert (known <= track.t[-1] + 2 * step).all()
    if any(item.command in JUMPS for item in mission.items):
        return
    assert (np.diff(track.item) >= 0).all()
    assert (np.diff(track.reached[np.isfinite(track.reached)]) >= -1e-9).all()
    for index, done in enumerate(track.reached):
        during = track.t[track.item == index]
        if math.isfinite(done) and len(during):
            assert 0 <= done + 1e-6 - during[-1] <= 2 * step + 1e-6


def visits(track: Track, east: float, north: float) -> int:
    """How often the track comes within 5 m."""
    near = np.hypot(*(track.position[:, :2] - [east, north]).T) < 5
    return int(np.count_nonzero(np.diff(near.astype(int)) == 1))


def circle(track: Track, *middle: float) -> list[float]:
    """The least and the greatest radius of the last ten seconds, and 1 where they turn left."""
    out = (track.position[-100:, :2] - middle) @ (1, 1j)
    return [abs(out).min(), abs(out).max(), np.sign(np.angle(out[-1] / out[-2]))]


MEASURES: dict[str, Callable[..., Real | list[float] | float]] = {
    "time": lambda track: track.t[-1],
    "reached": lambda track, item: track.reached[int(item) - 1],
    "unreached": lambda track, item: np.isfinite(track.reached[int(item) - 1]),
    "between": lambda track, one, two: track.reached[int(two) - 1] - track.reached[int(one) - 1],
    "after": lambda track, item: track.t[-1] - track.reached[int(item) - 1],
    "end": lambda track: track.position[-1],
    "away": lambda track: np.hypot(*track.position[-1, :2]),
    "east": lambda track: track.position[:, 0].max(),
    "highest": lambda track: track.position[:, 2].max(),
    "fastest": lambda track: track.velocity[:, 0].max(),
    "climb": lambda track: track.velocity[:, 2].max(),
    "rising": lambda track, up: track.position[track.position[:, 2] > up][0, :2],
    "sinking": lambda track, up: track.position[track.position[:, 2] > up][-1, :2],
    "abeam": lambda track, north: track.position[np.argmin(abs(track.position[:, 1] - north)), 2],
    "visits": visits,
    "circle": circle,
}
"""Of a track: m and m/s east, north and up of home, s; `rising` and `sinking` are the first and the
last place above a height, `abeam` the height at a place to the north, others are of items."""


def test_flights_are_as_the_table_has_them() -> None:
    for line in PREDICTED.read_text().splitlines()[2:]:
        words, *told = line.split(" | ")
        if told[0].startswith("refused: "):
            with pytest.raises(InputError, match=told[0].removeprefix("refused: ")):
                flown(words)
            continue
        track, *other = map(flown, words.split(" - "))
        for each in told:
            measure, _, values = each.partition(": ")
            name, *arguments = measure.split()
            of = [MEASURES[name](x, *map(float, arguments)) for x in (track, *other)]
            found = np.atleast_1d(np.subtract(of[0], of[1] if other else 0.0))
            expected, _, near = (values or "0, 0").partition(", ")
            wanted = np.array([float(x) for x in expected.split()])
            off = np.abs(found - wanted)[np.isfinite(wanted)]
            assert (off <= float(near)).all(), (line, each, found)


def test_circles_are_left_when_and_where_arduplane_left_them() -> None:
    parameters, *rows = (PREDICTED.parent / "circles.tsv").read_text().splitlines()[1:]
    for row in rows:
        height, speed, circle, onward, *told = row.split("\t")
        place = f"home={HOME.latitude},{HOME.longitude},{height} change_speed=0,{speed},-1"
        way = f"takeoff:0,400,100 waypoint:0,700,100 waypoint:0,1100,100 {circle} waypoint:{onward}"
        case, (seconds, *left) = given(f"plane {parameters} {place} {way}"), [*map(float, told)]
        body = PlaneBody(airspeed_exponent=1)  # as the simulator has it
        track = predict(case.mission, replace(case.vehicle, body=body))
        assert track.reached[4] - track.reached[3] == pytest.approx(seconds, abs=3), row
        out = track.position[track.item <= 4][-1, :2] - (400, 1100)
        assert math.dist(out, left) < 5, row
        assert -0.5 < math.hypot(*out) - math.hypot(*left) < 3, row  # rather wide than narrow


def test_flights_without_a_home_or_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    track = predict(given("homeless waypoint:0,0,30 waypoint:70,0,30").mission, COPTER)
    assert track.position[[0, -1]] == pytest.approx(np.array([[0, 0, 0], [70, 0, 30]]), abs=1)
    place = track.frame.latitude, track.frame.longitude  # below its first place
    assert place == pytest.approx((HOME.latitude, HOME.longitude))
    stays = given("takeoff waypoint:50,0,30 waypoint@0,0,30").mission
    assert predict(stays, COPTER).position[-1] == pytest.approx([50, 0, 30], abs=1)
    for nothing in ("", "change_speed=1,5 jump=1,-1"):
        assert len(flown(nothing).t) == 0
    useless = Vehicle(parameters={"LAND_SPEED": 0.0}, source="quad.param")
    with pytest.raises(InputError, match=r"quad\.param: LAND_SPEED: 0"):
        predict(given("takeoff return").mission, useless)
    # Legs of 12 m take 3 s, but PX4 circles for ten times that round ends with tiny radii.
    monkeypatch.setattr("faao_mav.autopilot.predict.LONGEST_COPTER", 120.0)
    ends = [f"waypoint:{10 * (k % 2)},{10 * (k % 3)},30" for k in range(9)]
    assert flown(" ".join(["px4", *ends])).t[-1] < 120
    with pytest.raises(InputError, match="more than 120 s"):
        flown(" ".join(["px4", *(f"{end},0,0.05" for end in ends)]))


metres = st.floats(-300, 300)
numbers = st.one_of(st.floats(-5, 60), st.sampled_from([math.nan, 0.0, -1.0, 1e9]))


@st.composite
def any_items(draw: st.DrawFn) -> MissionItem:
    """Items at valid places, with any parameters."""
    params = draw(st.tuples(*[numbers] * 4))
    if draw(st.booleans()):
        commands = [Command.NAV_WAYPOINT] * 3 + list(Command)
        frame = draw(st.sampled_from([Frame.GLOBAL_RELATIVE_ALT] * 4 + [Frame.GLOBAL, 10, 6]))
        height = draw(st.floats(0, 60)) + (HOME.altitude if frame == Frame.GLOBAL else 0)
        command = draw(st.sampled_from(commands))
        return at(draw(metres), draw(metres), height, *params, command=command, frame=frame)
    return do(draw(st.sampled_from([*Command, 183, 206])), *params)


STRICT = dict.fromkeys(("WPNAV_SPEED", "WPNAV_ACCEL", "MPC_ACC_HOR", "NAV_ACC_RAD"), 0.0) | {
    "ARMING_MIS_ITEMS": 127.0,
    "FENCE_ENABLE": 1.0,
    "FENCE_TYPE": 15.0,
    "MIS_TKO_LAND_REQ": 3.0,
    "GF_MAX_HOR_DIST": 10.0,
    "GF_MAX_VER_DIST": 10.0,
}
near = st.builds(
    Mission, st.lists(any_items(), max_size=8).map(tuple), st.sampled_from([None, HOME])
)


@settings(max_examples=60)
@drawn(near | missions(sound=False), st.sampled_from(VEHICLES), st.booleans())
def test_any_mission_is_predicted_or_refused_and_judged(
    mission: Mission, vehicle: Vehicle, bare: bool
) -> None:
    vehicle, track = vehicle if bare else replace(vehicle, parameters=STRICT), None
    try:
        track = predict(mission, vehicle.usable(), FRAME, step=0.5)
        check(mission, track, step=0.5)
    except InputError as refused:
        assert str(refused)
    limits = Limits() if bare else Limits(1.0, 50.0, 20.0, 5.0, 2.0)
    for finding in validate(ValidationContext(mission, vehicle, track, limits)):
        assert finding.item is None or 1 <= finding.item <= len(mission.items)
