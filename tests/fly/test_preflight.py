"""The gate before a flight: what it finds, what overrules it, that nothing is armed past it."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest
from conftest import FLYABLE, edited
from scenes import Scene, away, held_by
from stations import FENCE, HOME, RALLY, VEHICLE, a_mission, mock_of, peer_of, vehicle_of

from faao_mav import parse_plan, plan_mission
from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.files import MadeFor
from faao_mav.autopilot.px4 import px4_mode
from faao_mav.fly.preflight import LEAST_BATTERY, preflight
from faao_mav.fly.seen import Flight, Held
from faao_mav.fly.telemetry import Telemetry
from faao_mav.mission import Home, Mission
from faao_mav.mission.fence import Circle, Fence
from faao_mav.sim import MockAutopilot
from faao_mav.validate import Finding, Level
from faao_mav.wire.messages import Envelope, Heartbeat, ParamSet, SysStatus
from faao_mav.wire.protocol import GROUND_STATION, MissionType
from faao_mav.wire.transfer.exchange import Outcome
from faao_mav.wire.wire_items import wire_items
from faao_mav.workflow import Result

KINDS = pytest.mark.parametrize("kind", ["ardupilot", "px4"])
ANYWHERE = Fence(circles=(Circle((HOME.latitude, HOME.longitude), 5000.0, inclusion=True),))


FENCED = {"FENCE_ENABLE": 1, "FENCE_TYPE": 4}


def holding(
    mission: Mission, kind: str = "ardupilot", parameters: Mapping[str, float] | None = None
) -> MockAutopilot:
    mock = mock_of(kind, parameters=parameters)
    for part in MissionType:
        mock.lists.replace(part, wire_items(mission, part, vehicle_of(kind)))
    return mock


def found(
    flight: Flight | None = None, mock: MockAutopilot | None = None, **changes: Any
) -> dict[str, Finding]:
    """Return by rule what is found of a mission held by a vehicle that stands at home.

    It has a full battery and rests, but for `changes`.
    """
    mission = a_mission(12)
    mock = mock or holding(mission)
    allowed = {name: changes.pop(name, False) for name in ("elsewhere", "untimed")}
    held, told = changes.pop("held", held_by(mock)), {"battery": 100, "armed": False} | changes
    seen = Telemetry(peer_of(mock.behaviour.family.key), ())
    seen.place = told.get("place", HOME)
    seen.stations = {*told.get("stations", ())}
    if told["battery"] is not None:
        seen.status = SysStatus(0, 0, told["battery"])
    autopilot, armed = mock.vehicle.family.mav_autopilot, 128 * told["armed"]
    seen.heartbeat = Heartbeat(2, autopilot, armed | 1, told.get("mode", mock.mode), 4)
    found = preflight(flight or Flight(mission), held, seen, **allowed)
    return {each.rule: each for each in found}


def errors(findings: Mapping[str, Finding]) -> set[str]:
    return {rule for rule, each in findings.items() if each.level is Level.ERROR}


@KINDS
def test_nothing_stands_against_a_vehicle_that_is_ready(kind: str) -> None:
    assert errors(found(mock=holding(a_mission(12), kind))) == set()


def test_it_has_to_stand_where_the_mission_was_made_for() -> None:
    for place, wrong, told in (
        (away(10.0, 5.0), set[str](), ""),
        (away(25.0), {"place-home"}, "25 m from the mission's home, not within 20 m"),
        (away(2_200.0, -32.0), {"place-home", "place-height"}, "2200 m from the mission's home"),
        (away(0.0, -32.0), {"place-height"}, "32 m lower than the mission's home, not within 10 m"),
        (away(0.0, 12.0), {"place-height"}, "12 m higher than the mission's home"),
        (Home(47.4, 8.5, 584.0), {"place-home", "place-first"}, "km from the mission's home"),
        (Home(35.363262, -30.834763, 584.0), {"place-home", "place-first"}, "the mission's home"),
    ):
        findings = found(place=place)
        assert errors(findings) == wrong
        assert told in " ".join(findings[rule].message for rule in wrong)
        overruled = found(place=place, elsewhere=True)
        assert {rule for rule in wrong if overruled[rule].level is Level.WARNING} == wrong
        assert all("--elsewhere" in overruled[rule].action for rule in wrong)


def test_elsewhere_allows_another_place_and_nothing_else() -> None:
    fence = Fence(circles=(Circle((HOME.latitude, HOME.longitude), 2000.0, inclusion=True),))
    mission = a_mission(12, fence=fence)
    mock = holding(mission, parameters=FENCED)
    assert errors(found(Flight(mission), mock)) == set()
    findings = found(Flight(mission), mock, place=away(3_000.0), elsewhere=True)
    assert "fence" in " ".join(errors(findings))  # the way to the first place leaves it
    assert "armed" in errors(found(armed=True, elsewhere=True, untimed=True))
    assert "position-unknown" in errors(found(place=None, elsewhere=True))


def test_without_a_home_the_first_place_counts() -> None:
    mission = replace(a_mission(12), home=None)
    findings = found(Flight(mission), place=away(400.0))
    assert errors(findings) == set()
    assert errors(found(Flight(mission), place=away(600.0))) == {"place-first"}
    far = a_mission(12, shift=0.02)
    far = replace(far, items=far.items[1:])  # 2 km from its home, which is where it stands
    assert found(Flight(far), holding(far))["place-first"].level is Level.WARNING


def test_a_home_without_a_height_is_told() -> None:
    mission = replace(a_mission(12), home=Home(HOME.latitude, HOME.longitude, math.nan))
    findings = found(Flight(mission), place=away(0.0, -32.0))
    assert errors(findings) == set()
    assert findings["place-height-unknown"].level is Level.WARNING


def test_its_own_home_may_be_elsewhere() -> None:
    held = replace(held_by(holding(a_mission(12))), home=away(210.0))
    findings = found(held=held)
    assert findings["returns-elsewhere"].level is Level.WARNING
    assert "210 m" in findings["returns-elsewhere"].message


def test_it_has_to_be_the_vehicle_that_the_mission_was_made_for() -> None:
    for made_for, mistaken in (
        (MadeFor("px4", "copter", "as the file says"), True),
        (MadeFor("ardupilot", "plane", "as the plan says"), True),
        (MadeFor("ardupilot", "vehicle of MAV_TYPE 19", "as the file says"), True),
        (MadeFor("px4", None, "as m.params beside it says"), True),
        (MadeFor("ardupilot", "copter", "as the plan says"), False),
        (MadeFor("ardupilot", None, "as m.param beside it says"), False),
        (MadeFor(), False),
    ):
        findings = found(Flight(a_mission(12), made_for=made_for))
        assert errors(findings) == ({"vehicle-other"} if mistaken else set())
        if mistaken:
            message = findings["vehicle-other"].message
            assert made_for.by in message
            assert "the vehicle is ardupilot and a copter" in message


def test_what_another_mission_left_behind_is_found() -> None:
    left = holding(a_mission(12, rally=RALLY))
    assert errors(found(mock=left)) == {"holds-rally"}
    fenced = a_mission(12, fence=ANYWHERE)
    findings = found(mock=holding(fenced))
    assert findings["holds-fence"].level is Level.WARNING  # FENCE_ENABLE is 0
    findings = found(mock=holding(fenced, parameters=FENCED))
    assert errors(findings) == {"holds-fence"}
    assert "upload --clear-rest" in findings["holds-fence"].action
    assert errors(found(Flight(fenced), holding(fenced, parameters=FENCED))) == set()


def test_what_it_holds_has_to_be_what_the_file_has() -> None:
    other = holding(a_mission(12, shift=1e-4))
    assert "holds-mission" in errors(found(mock=other))
    fenced = a_mission(12, fence=ANYWHERE)
    assert "holds-fence" in errors(found(Flight(fenced), holding(a_mission(12, fence=FENCE))))
    assert "holds-fence" in errors(found(Flight(fenced), holding(a_mission(12))))


def test_its_own_parameters_have_to_be_those_that_the_mission_is_timed_for() -> None:
    mission, parameters = a_mission(12), {"WPNAV_ACCEL": 400.0, "WPNAV_JERK": 1.0, "WP_ACC": 4.0}
    flight = Flight(mission, Vehicle("ardupilot", "copter", parameters))
    findings = found(flight)
    assert errors(findings) == {"timing-other"}
    message = findings["timing-other"].message
    assert "timed for: WPNAV_ACCEL is 250, not 400; predicted to take" in message
    assert "--untimed" in findings["timing-other"].action
    assert errors(found(flight, untimed=True)) == set()
    assert errors(found(flight, holding(mission, parameters={"WPNAV_ACCEL": 400.0}))) == set()
    newer = holding(mission)
    newer.parameters.values["WP_ACC"] = newer.parameters.values.pop("WPNAV_ACCEL") / 100
    assert "WP_ACC is 2.5, not 4" in found(flight, newer)["timing-other"].message
    newer.parameters.values["WP_ACC"] = 4.0
    assert errors(found(flight, newer)) == set()
    only_old = Flight(mission, Vehicle("ardupilot", "copter", {"WPNAV_ACCEL": 400.0}))
    assert errors(found(only_old, newer)) == set()
    assert "timing-unknown" in found()


def test_parameters_that_cannot_be_read_are_named() -> None:
    flight = Flight(a_mission(12), Vehicle("ardupilot", "copter", {"WPNAV_ACCEL": 250.0}))
    mute = holding(a_mission(12))
    for name in ("WPNAV_ACCEL", "FS_THR_ENABLE"):
        del mute.parameters.values[name]
    findings = found(flight, mute)
    assert errors(findings) == {"timing-unread"}
    assert "WP_ACC or WPNAV_ACCEL" in findings["timing-unread"].message
    assert errors(found(flight, mute, untimed=True)) == set()
    assert "parameters-unread" not in findings
    del mute.parameters.values["FENCE_RADIUS"]
    assert found(flight, mute)["parameters-unread"].message.endswith("defaults: FENCE_RADIUS")
    assert findings["on-rc-lost"].level is Level.WARNING
    assert "FS_THR_ENABLE not read" in findings["on-rc-lost"].message


def test_the_mission_is_validated_with_its_own_parameters() -> None:
    low = {"FENCE_ENABLE": 1, "FENCE_TYPE": 1, "FENCE_ALT_MAX": 25.0}
    mock = holding(a_mission(12), parameters=low)
    assert errors(found(mock=mock)) == {"ardupilot-fence-ceiling"}


def relay(**changes: Any) -> Result:
    """Return a mission made for a plan with a battery."""
    slow = {
        "vehicle.max_speed": 6,
        "flight.duration": 16,
        "vehicle.power": {},
        "vehicle.battery": {"capacity_wh": 20, "reserve": 20},
    }
    ends = {f"flight.{end}_velocity": "hover" for end in ("start", "end")}
    return plan_mission(parse_plan(edited(FLYABLE, slow | ends | changes)))


def test_a_low_battery_is_not_flown_with() -> None:
    for percent, rules in ((100, set()), (LEAST_BATTERY - 1, {"battery-low"})):
        assert errors(found(battery=percent)) == rules
    assert found(battery=None)["battery-unknown"].level is Level.WARNING


def test_a_plan_tells_what_the_flight_takes_of_the_battery() -> None:
    result = relay()
    conversion, check = result.conversion, result.check
    assert conversion is not None
    assert check is not None
    assert check.energy is not None
    takes = 100 * check.energy.total / 20
    flight = Flight.planned(conversion, result.solution)
    mock = holding(conversion.mission, parameters=conversion.vehicle.parameters)
    findings = found(flight, mock, battery=int(takes) + 19)
    assert errors(findings) == {"battery-low"}
    assert f"takes {takes:.0f} %, and is to leave 20 %" in findings["battery-low"].message
    assert errors(found(flight, mock, battery=int(takes) + 22)) == set()
    slow = holding(conversion.mission)
    assert errors(found(flight, slow)) >= {"timing-other"}
    assert errors(found(flight, slow, untimed=True)) == set()


def test_who_has_the_vehicle_keeps_it() -> None:
    assert errors(found(armed=True)) == {"armed"}
    assert errors(found(stations=("system 250, component 190",))) == {"ground-station"}


def test_a_mode_in_which_it_flies_by_itself_is_not_armed_in() -> None:
    for kind, mode, refused in (
        ("ardupilot", 0, False),  # STABILIZE
        ("ardupilot", 6, True),  # RTL
        ("ardupilot", 18, True),  # THROW
        ("px4", px4_mode(3, 0), False),  # Position
        ("px4", px4_mode(4, 2), True),  # Takeoff
        ("px4", px4_mode(4, 5), True),  # Return
    ):
        mock = holding(a_mission(12), kind)
        assert ("mode" in errors(found(mock=mock, mode=mode))) == refused
        streamed = Flight(a_mission(12), streamed=True)  # its mode is set before it is armed
        assert "mode" not in errors(found(streamed, mock, mode=mode))


LOSSES: tuple[tuple[str, dict[str, float], str, str, Level], ...] = (
    ("ardupilot", {}, "rc-lost", "it returns (RTL) (FS_THR_ENABLE 1)", Level.NOTE),
    ("ardupilot", {"FS_THR_ENABLE": 0}, "rc-lost", "does nothing", Level.WARNING),
    ("ardupilot", {"FS_OPTIONS": 1}, "rc-lost", "flies on (FS_OPTIONS 1)", Level.WARNING),
    ("ardupilot", {}, "ground-station-lost", "nothing (FS_GCS_ENABLE 0)", Level.WARNING),
    ("ardupilot", {"FS_GCS_ENABLE": 5}, "ground-station-lost", "after 5 s", Level.NOTE),
    ("ardupilot", {"BATT_MONITOR": 0}, "battery-low", "nothing (BATT_MONITOR 0)", Level.WARNING),
    (
        "ardupilot",
        {"BATT_FS_LOW_ACT": 2, "BATT_LOW_MAH": 300},
        "battery-low",
        "returns (RTL) (BATT_FS_LOW_ACT 2) at 10.5 V or 300 mAh left",
        Level.NOTE,
    ),
    ("ardupilot", {"RTL_ALT": 4000}, "return", "40 m above home", Level.NOTE),
    ("ardupilot", {"FENCE_ENABLE": 1}, "fence-left", "it returns (FENCE_ACTION)", Level.NOTE),
    ("ardupilot", {}, "fence-left", "it flies on (FENCE_ENABLE)", Level.WARNING),
    ("px4", {}, "rc-lost", "returns (NAV_RCL_ACT 2) after 0.5 s", Level.NOTE),
    ("px4", {"COM_RCL_EXCEPT": 1}, "rc-lost", "flies on", Level.WARNING),
    ("px4", {}, "ground-station-lost", "does nothing (NAV_DLL_ACT 0)", Level.WARNING),
    ("px4", {"NAV_DLL_ACT": 2}, "ground-station-lost", "after 10 s", Level.NOTE),
    ("px4", {"COM_LOW_BAT_ACT": 3}, "battery-low", "at 0.07 of its charge, lands", Level.NOTE),
    ("px4", {"RTL_RETURN_ALT": 30.0}, "return", "30 m above home", Level.NOTE),
    ("px4", {}, "fence-left", "it holds (GF_ACTION)", Level.NOTE),
    ("px4", {"GF_ACTION": 1}, "fence-left", "it says so and flies on (GF_ACTION)", Level.WARNING),
)


def test_what_it_does_on_a_loss_or_at_its_fence_is_told() -> None:
    fenced = a_mission(12, fence=ANYWHERE)
    for kind, parameters, loss, told, level in LOSSES:
        finding = found(Flight(fenced), holding(fenced, kind, parameters))[f"on-{loss}"]
        assert told in finding.message
        assert finding.level is level


# ---- on the wire


@KINDS
def test_a_parameter_that_is_changed_before_it_is_armed_counts(kind: str) -> None:
    name, value = {"ardupilot": ("WPNAV_ACCEL", 250.0), "px4": ("MPC_ACC_HOR", 3.0)}[kind]
    flight = Flight(a_mission(12), Vehicle(kind, "copter", {name: value}))
    assert Scene(kind, flight=flight, arm=True).run() == "finished"
    scene = Scene(kind, flight=flight, arm=True)

    def change(now: float) -> None:
        scene.mock.on(Envelope(GROUND_STATION, ParamSet(VEHICLE, name, 2 * value, 9)), now)

    assert scene.run(events=[(1.5, change)]) == "refused"
    assert scene.orders == []
    assert f"{name} is {2 * value:g}, not {value:g}" in scene.watch.outcome.text
    assert Scene(kind, flight=flight, arm=True, parameters={name: 2 * value}).run() == "refused"
    untimed = Scene(kind, flight=flight, arm=True, parameters={name: 2 * value}, untimed=True)
    assert untimed.run() == "finished"


def test_what_was_never_read_does_not_stand_for_nothing() -> None:
    held = held_by(holding(a_mission(12)))
    lists = {MissionType.MISSION: held.lists[MissionType.MISSION]}
    unread = Held(lists, held.reading, {MissionType.FENCE: Outcome("silent")})
    assert errors(found(held=unread)) == {"holds-fence"}
