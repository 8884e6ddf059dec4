"""The rules: each speaks and is silent on both sides of its limit, and what holds for all."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import FLYABLE, SMALL, edited
from judged import COPTER, LINK, VEHICLES, Given, check, given, track

from faao_mav.autopilot.body import CopterBody
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.plan import parse_plan
from faao_mav.validate import RULES, Level, validate
from faao_mav.validate.comparison import compare_with_plan
from faao_mav.validate.speeds import beyond_lean

LIMITS = Path(__file__).parents[1] / "data" / "validate" / "limits.tsv"
FLOWN = given("takeoff return").mission
ROWS = [line.split("\t") for line in LIMITS.read_text().splitlines() if not line.startswith("#")]


@pytest.mark.parametrize("name", sorted({row[0] for row in ROWS}))
def test_the_rule_speaks_and_is_silent(name: str) -> None:
    for rule, item, trips, passes in ROWS:
        if rule == name:
            check(rule, given(trips), None if item == "-" else int(item), given(passes))


def test_every_rule_is_tried_and_can_be_cited() -> None:
    others = {"radio-values", "link-unmeasured", "link-off-map"}
    assert {row[0] for row in ROWS} | others == {rule.id for rule in RULES}
    assert len({rule.id for rule in RULES}) == len(RULES)
    for rule in RULES:
        assert rule.summary
        assert rule.source
        assert rule.id.replace("-", "").isalnum()  # as users' programs know it
        assert rule.id == rule.id.lower().strip("-")


def test_a_doubtful_radio_is_told_with_the_likely_slip() -> None:
    def judged(changes: Mapping[str, float]) -> Given:
        plan = parse_plan(edited(SMALL, {f"radio.{key}": v for key, v in changes.items()}))
        return Given(FLOWN, COPTER, link=replace(LINK, radio=plan.radio))

    noise, power, band = "relay.noise_dbm", "base_station.power_dbm", {"bandwidth_mhz": 20}
    density = "if it is a density (dBm/Hz), add 10 log10 of the bandwidth in Hz"
    for trips, passes, action in (
        ({noise: 91, **band}, {noise: -91}, "is a minus missing?"),
        ({noise: -30}, {noise: -91}, "receivers have -80 to -120 dBm"),
        ({noise: -174, **band}, {noise: -140}, density),
        ({noise: -174}, {noise: -140}, density),
        ({noise: -110, **band}, {noise: -101, **band}, ""),
        ({power: 100}, {power: 40}, ""),
    ):
        check("radio-values", judged(trips), None, judged(passes))
        told = judged(trips).by("radio-values")[0]
        assert action in told.action


def test_a_route_beyond_what_the_gain_was_measured_at_is_told() -> None:
    """Two of the twenty slots may be beyond it by more than a degree or 5 %, a third is told."""
    solution = optimize(parse_plan(FLYABLE))
    way = track([[*w, 40.0] for w in solution.w], [0] * 20, 8.0)

    def told(hop: str, **measured: list[float]) -> tuple[str, ...]:
        plan = parse_plan(edited(FLYABLE, {f"radio.{hop}": measured}))
        link, _ = compare_with_plan(replace(solution, problem=build_problem(plan)), way)
        found = Given(FLOWN, COPTER, link=replace(LINK, unmeasured=link.unmeasured))
        assert tuple(x.message for x in found.by("link-unmeasured")) == link.unmeasured
        return link.unmeasured

    away = np.hypot(*(solution.w - np.array([60.0, 60.0])).T)
    d = np.sort(np.hypot(away, 40.0)).tolist()
    angle = np.sort(np.degrees(np.arctan2(40.0, away))).tolist()
    hop, least = "ground_user.gain", 0.01
    assert told(hop, elevation_deg=[0, angle[-3] - 1 + least]) == ()
    (text,) = told(hop, elevation_deg=[0, angle[-3] - 1 - least])
    seen = f"the ground user sees the route {angle[0]:.0f} to {angle[-1]:.0f} degrees high"
    assert text == f"{seen}; the gain was measured from 0 to {angle[-3] - 1 - least:.0f}"
    assert told(hop, distance_m=[d[2] * 1.05 - least, 1e5]) == ()
    (text,) = told(hop, distance_m=[d[2] * 1.05 + least, 1e5])
    assert text.startswith(f"the route is {d[0]:.0f} to {d[-1]:.0f} m from the ground user; ")
    both = told("gain", elevation_deg=[0, 1], distance_m=[1e4, 1e5])
    assert ["base station" in text for text in both] == [True, True, False, False]
    assert told(hop, distance_m=[0.1, d[-3] / 1.05 + least]) == ()
    assert told(hop, distance_m=[0.1, d[-3] / 1.05 - least])
    assert told(hop, elevation_deg=[angle[2] + 1 - least, 90]) == ()
    assert told(hop, elevation_deg=[angle[2] + 1 + least, 90])


def test_the_airframe_decides_what_leaning_gives() -> None:
    fast = given("copter takeoff change_speed=1,8,-1 return")
    sleek = replace(fast.vehicle, body=CopterBody(linear_drag=0, quadratic_drag=0))
    draggy = replace(fast, vehicle=replace(fast.vehicle, body=CopterBody(linear_drag=1.0)))
    quick = given("copter takeoff change_speed=1,20,-1 return")
    check("speed-lean", draggy, 2, replace(quick, vehicle=sleek))
    solution = optimize(parse_plan(FLYABLE))
    vehicle, v, a = solution.plan.aircraft, np.zeros_like(solution.v), np.zeros_like(solution.a)
    v[:], a[:2] = (10.0, 0.0), (2.5, 0.0)  # drag of 5.4 m/s², and g tan 30 degrees is 5.66
    told = f"up to 39 degrees against the drag of vehicle.body, and for {2 * solution.t[1]:.1f} s"
    asked = replace(solution, v=v, a=a)
    assert told in (beyond_lean(asked, vehicle) or "")
    assert beyond_lean(asked, replace(vehicle, parameters={"ANGLE_MAX": 4500})) is None
    assert beyond_lean(replace(asked, a=-a), vehicle) is None  # drag slows it down


def test_what_findings_say() -> None:
    link = replace(LINK, predicted_delivered=0.5)
    (found,) = Given(FLOWN, COPTER, link=link).by("link-rate-reduced")
    assert found.message.endswith("25.0 %")
    link = replace(LINK, off_map="off the map of the gain at [30, 40] m, after 12 s")
    (found,) = Given(FLOWN, COPTER, link=link).by("link-off-map")
    assert "predicted to be off the map of the gain at [30, 40] m, after 12 s" in found.message
    assert not [*Given(FLOWN, COPTER, link=LINK).by("link-off-map")]
    far = replace(LINK, path_error=7e6, away=7e6, rms_position_error=7e6, predicted_delivered=0.0)
    assert [each.rule for each in validate(Given(FLOWN, COPTER, link=far))] == ["link-elsewhere"]
    (found,) = given("home=47.4,8.5,400 waypoint@8.5012,47.4003,30").by("too-far")
    assert found.action == "latitude and longitude look exchanged: correct them"
    (found,) = given("px4 square:100,50.1 takeoff return").by("fence-home")
    assert "PX4 says so (Geofence invalid), and flies the mission all the same" in found.message
    (found,) = given("px4 waypoint:0,9,9 takeoff").by("px4-takeoff-first")
    assert f"{found.message}: {found.action}".count("item 1") == 2
    (found,) = given("copter square:100 takeoff return").by("fence-not-kept")
    assert found.action == "set FENCE_ENABLE to 1 for the vehicle to turn back"


def test_rules_of_the_other_autopilot_are_silent_and_all_say_what_to_do() -> None:
    odd = "change_speed=1,20,-1 waypoint@0,0,30 waypoint:0,9,0,2.5,3,3,3 waypoint:0,9,9/1"
    for vehicle in VEHICLES:
        found = validate(Given(given(f"takeoff {odd} return").mission, vehicle))
        other = "px4-" if vehicle.autopilot == "ardupilot" else "ardupilot-"
        assert found
        for finding in found:
            assert not finding.rule.startswith(other)


def test_worst_first_then_by_item_and_nothing_of_a_sound_mission() -> None:
    found = validate(given("homeless waypoint:0,9,0 waypoint:0,9,9/1 change_speed=1,0,-1"))
    order = [([*Level].index(each.level), each.item or 0) for each in found]
    assert order == sorted(order)
    assert len({level for level, _ in order}) == 3
    way = "waypoint:0,100,30,6 waypoint:100,150,30 waypoint:200,160,30,10"
    for vehicle in ("copter", "px4", "px4 GF_MAX_HOR_DIST=nan"):  # which counts as not given
        assert validate(given(f"{vehicle} takeoff change_speed=1,8,-1 {way} return")) == ()


def test_what_is_missing_to_px4_is_named() -> None:
    for items, missing in (
        ("MIS_TKO_LAND_REQ=2 waypoint:0,9,9", "NAV_LAND"),
        ("MIS_TKO_LAND_REQ=3 waypoint:0,9,9", "NAV_TAKEOFF and NAV_LAND"),
        ("MIS_TKO_LAND_REQ=4 waypoint:0,9,9 land", "NAV_TAKEOFF"),
    ):
        (found,) = given(f"px4 {items}").by("px4-takeoff-or-landing-missing")
        assert found.action == f"add {missing}, or change MIS_TKO_LAND_REQ"
    (second,) = given("px4 takeoff waypoint:0,9,9 takeoff").by("px4-takeoff-first")
    assert second.action == "remove it"
    (unknown,) = given("copter home=47,8,nan takeoff").by("home-height")
    assert unknown.message.startswith("the file has no height of home")
