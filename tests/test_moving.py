"""Stations that move: what a plan says of them, and what comes of it."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import MISSIONS, SMALL, edited
from hypothesis import given
from hypothesis import strategies as st

from faao_mav import optimize, plan_mission
from faao_mav.errors import PlanError
from faao_mav.plan import Plan, parse_plan, read_plan
from faao_mav.plan.station import MAX_POINTS
from faao_mav.report import summary
from faao_mav.validate import Level
from faao_mav.validate.demands import LATE_START

BASE, USER = "radio.base_station", "radio.ground_user"
HEAD = "time_s,east_m,north_m\n"
WAY = HEAD + "".join(f"{t},{5 * t},{60 - t}\n" for t in range(0, 12, 2))

NUMBERS = st.floats(-9e4, 9e4).map(lambda x: round(x, 3))


@st.composite
def tracks(draw: st.DrawFn) -> list[tuple[float, float, float]]:
    """Return times, which rise from anywhere for the 10 s of the small plan or more, and places."""
    steps = draw(st.lists(st.floats(1, 50), min_size=1, max_size=20))
    times = draw(NUMBERS) + np.cumsum([0.0, *steps, 10.0])
    return [(float(t), draw(NUMBERS) / 1800, draw(NUMBERS) / 1800) for t in times]


def moving(track: str, **changes: Any) -> Plan:
    """Return the small plan whose user has the track of a text."""
    return parse_plan(edited(SMALL, {f"{USER}.track": track, f"{USER}.position": None, **changes}))


@given(tracks())
def test_a_track_is_straight_between_its_points_and_its_first_is_the_start(
    points: list[tuple[float, float, float]],
) -> None:
    plan = moving(HEAD + "".join(f"{t!r},{x!r},{y!r}\n" for t, x, y in points))
    t, x, y = np.array(points).T
    station, since = plan.radio.ground_user, t - t[0]
    np.testing.assert_allclose(station.position, (x[0], y[0]))
    np.testing.assert_allclose(station.at(since), np.stack([x, y], axis=1), atol=1e-6)
    between = station.at((since[1:] + since[:-1]) / 2)
    np.testing.assert_allclose(between, (station.at(since[1:]) + station.at(since[:-1])) / 2)
    held = station.at(np.array([-1.0, since[-1] + 1e6]))
    np.testing.assert_allclose(held, [[x[0], y[0]], [x[-1], y[-1]]])
    assert parse_plan(plan.text).radio == plan.radio


def test_files_of_tracks_are_in_the_text_of_the_plan_or_refused(tmp_path: Path) -> None:
    rows = "".join(f"a, {row}\n" for row in WAY.splitlines()[1:])
    (tmp_path / "convoy.csv").write_text(f"# a convoy\nname, TIME_S, east_m, north_m\n{rows}")
    points = "".join(
        f'<trkpt lat="{-35.363262 + t * 1e-5}" lon="149.165237"><time>2026-05-01T12:00:{t:02}Z'
        "</time></trkpt>"
        for t in range(11)
    )
    (tmp_path / "ship.GPX").write_text(
        f'<?xml version="1.0"?><gpx xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>{points}'
        "</trkseg></trk></gpx>"
    )
    changes: dict[str, str | None] = {f"{USER}.track": "convoy.csv", f"{BASE}.track": "ship.GPX"}
    changes |= {f"{USER}.position": None, f"{BASE}.position": None}
    (tmp_path / "plan.yaml").write_text(edited(SMALL, changes))
    plan = read_plan(tmp_path / "plan.yaml")
    assert plan.radio.ground_user == moving(WAY).radio.ground_user
    north = plan.radio.base_station.at(np.array([0.0, 10.0]))[:, 1]
    np.testing.assert_allclose(north, [0, 11.1], atol=0.05)
    for each in (tmp_path / "convoy.csv", tmp_path / "ship.GPX"):
        each.unlink()
    assert parse_plan(plan.text).radio == plan.radio
    assert plan.changed({"flight.duration": 9}).radio == plan.radio
    for text, told in (
        ("", "ship.gpx: not XML"),
        ("<gpx/>", "ship.gpx: points with a time: 0"),
        ("<!DOCTYPE x><gpx/>", "ship.gpx: a document type or entities"),
        ('<gpx><trkpt lat="1" lon="2"/></gpx>', "point 1: lat '1', lon '2', time ''; give degrees"),
    ):
        (tmp_path / "ship.gpx").write_text(text)
        with pytest.raises(PlanError, match=re.escape(told)):
            moving(str(tmp_path / "ship.gpx"))
    with pytest.raises(PlanError, match="points with a time: 5,001"):
        moving(HEAD + "".join(f"{t},0,0\n" for t in range(MAX_POINTS + 1)))


CIRCLING = """
site: {origin: {latitude: -35.36, longitude: 149.165}}
vehicle: {type: plane, min_speed: 12, max_speed: 20, max_airspeed: 20, max_acceleration: 1.4}
flight: {start: [0, 150], end: [150, 0], altitude: 80, duration: 20, time_step: 0.5,
         start_velocity: free, end_velocity: free}
radio:
  base_station: {position: [0, 0], power_dbm: 10}
  relay: {power_dbm: 10}
  ground_user: {position: [200, 200]}
  fading: none
optimizer: {tolerance: 1.0e-8}
"""


def test_with_both_stations_at_u_a_plane_flies_as_to_stations_that_stand_in_a_wind_of_minus_u() -> (
    None
):
    u = np.array([4.0, 3.0])
    plan = parse_plan(CIRCLING)
    standing = plan.changed({"site.wind": {"speed": 5, "from": math.degrees(math.atan2(*u))}})
    gone = plan.flight.time_step * (plan.flight.slots - 1) * u
    moving = plan.changed({
        "flight.end": plan.flight.end + gone,
        "vehicle.max_speed": 25,  # over the ground, which does not bind: solvers have one unit then
        f"{BASE}.velocity": u, f"{USER}.velocity": u,
    })  # fmt: skip
    calm, windy = optimize(moving), optimize(standing)
    np.testing.assert_allclose(calm.I_U, windy.I_U, atol=1e-6)
    np.testing.assert_allclose(calm.I_G, windy.I_G, atol=1e-6)
    np.testing.assert_allclose(calm.w - calm.t[:, None] * u, windy.w, atol=1e-3)
    assert calm.delivered_rate == pytest.approx(windy.delivered_rate, abs=1e-6)
    assert max(calm.residuals().values()) < 1e-6


def test_the_convoy_is_told_and_flown_as_planned() -> None:
    result = plan_mission(read_plan(MISSIONS / "convoy.yaml"))
    solution, link = result.solution, result.check.link if result.check else None
    assert link is not None
    assert link.share > 0.99
    assert link.late_share is not None
    assert link.late_share < 0.9
    first, late = (solution.problem.begun(t).bs_uav.gains.station for t in (0.0, LATE_START))
    np.testing.assert_allclose(late - first, [[40, 0]] * len(solution.t), atol=1e-9)
    text = summary(result)
    assert "moving       base 398 m from [0, 0] to [398, 0]; user 498 m from [150, 220]" in text
    assert f"it begins {link.begins:.0f} s after the mission" in text
    assert {finding.level for finding in result.findings} == {Level.NOTE}
    assert "link-moving" in {finding.rule for finding in result.findings}
