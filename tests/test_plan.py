"""`plan.yaml`: what is read, and what bad input gets."""

import copy
import json
import pickle
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import MISSIONS, SMALL, contents, edited
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.autopilot.body import ARDUCOPTER_BODY, PX4_BODY
from faao_mav.errors import InputError, PlanError
from faao_mav.files import table
from faao_mav.plan import Plan, checks, parse_plan, read_plan, reference
from faao_mav.plan.reader import changed
from faao_mav.plan.yaml_text import dump_yaml, load_yaml

NAN, INF = float("nan"), float("inf")


SMALL_DATA = load_yaml(SMALL, "small.yaml")


def refused(changes: dict[str, Any]) -> str:
    with pytest.raises(PlanError) as caught:
        Plan.from_dict(changed(SMALL_DATA, changes), "small.yaml")
    return str(caught.value)


def test_sample_plans_are_read_as_they_stand_and_the_papers_is_section_iv() -> None:
    for path in sorted(MISSIONS.glob("*.yaml")):
        text, plan = path.read_text(), read_plan(path)
        assert plan.text == text or ".csv" in text  # which stands beside it
        assert contents(parse_plan(plan.text)) == contents(plan)
    plan = read_plan(MISSIONS / "paper.yaml")
    flight, radio, vehicle = plan.flight, plan.radio, plan.vehicle
    assert (flight.start, flight.end, flight.altitude) == ((0, 350), (350, 0), 100)
    assert (flight.duration, flight.time_step, flight.slots) == (50, 0.2, 250)
    assert flight.start_velocity is flight.end_velocity is None
    assert not flight.bound_first_acceleration
    assert (vehicle.max_speed, vehicle.max_acceleration) == (100, 5)
    stations = radio.base_station, radio.relay, radio.ground_user
    assert [station.antennas for station in stations] == [2, 2, 2]
    assert (radio.base_station.position, radio.ground_user.position) == ((0, 0), (300, 300))
    assert radio.base_station.power == radio.relay.power == pytest.approx(0.1)
    assert radio.relay.noise == radio.ground_user.noise == pytest.approx(1e-15)
    assert radio.reference_gain == pytest.approx(1e-5)
    assert (radio.rician_factor, radio.modulation) == (3, "bpsk")


def test_values_are_those_of_yaml_1_2_and_other_text_is_no_plan() -> None:
    text = "{a: 010, b: no, c: 2:30, d: 2024-01-01, e: -.inf, f: .5, g: 0x1F, h: 1_0, i: ~, <<: =}"
    assert load_yaml(text, "plan") == {
        "a": 10, "b": "no", "c": "2:30", "d": "2024-01-01", "e": -INF, "f": 0.5, "g": "0x1F",
        "h": "1_0", "i": None, "<<": "=",
    }  # fmt: skip
    assert load_yaml("%YAML 1.1\n---\na: 010\n", "plan") == {"a": 10}
    for written in ("1e-4", "1.0e-4", "0.0001", "1E-4"):
        assert load_yaml(f"a: {written}", "plan") == {"a": 1e-4}
    for text, part in (
        ("", "not nothing"),
        ("flight: [1\n", "line 2"),
        ("a: 1\nb: 2\na: 3\n", 'line 3, column 1: not valid YAML: found duplicate key "a"'),
        ("a: &x 1\nb: *x\n", "line 2, column 4: aliases"),
        ("[" * 5_000, "nested more than 20 deep"),
        ('a: !!float ""\n', "line 1, column 4: tags (tag:yaml.org,2002:float) are not used"),
        ("a: !mine {b: 1}\n", "line 1, column 4: tags (!mine) are not used in plans"),
        ("a: {b: 1}\nc: {<<: *a}\n", "line 2, column 9: aliases"),
        ("? {a: 1}\n: 1\n", "line 1, column 3: not valid YAML: a key has to be a word"),
        ("? [a]\n: 1\n", "line 1, column 3: not valid YAML: a key has to be a word"),
        ("a: {1: 2}\n", "line 1, column 5: not valid YAML: a key has to be a word, not 1"),
        ("a: 1\n~: 2\n", "line 2, column 1: not valid YAML: a key has to be a word, not ~"),
        ("a:\n\tb: 1\n", "found character '\\t' that cannot start any token; indent with spaces"),
        ("QGC WPL 110\n", "a mission, not a plan; faao-mission validate takes missions"),
        ('{\n "fileType": "Plan"}', "a mission, not a plan"),
        ("a: !!python/object:os.system 1\n", "line 1"),
        ("a: " + "9" * 5000, "thousands of digits"),
        ("a\x00b", "not valid YAML"),
        ("a: 1\n---\nb: 2\n", "line 2"),
        ("x" * 655_361, "at most 655,360"),
    ):
        with pytest.raises(PlanError, match=r"^p\.yaml: ") as caught:
            parse_plan(text, "p.yaml")
        assert part in str(caught.value)


@given(st.dictionaries(st.text(), st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda part: st.lists(part, max_size=3) | st.dictionaries(st.text(), part, max_size=3),
    max_leaves=8,
)))  # fmt: skip
def test_what_is_dumped_is_loaded(data: dict[str, Any]) -> None:
    assert load_yaml(dump_yaml(data), "plan") == data


def test_the_wind_blows_away_from_where_it_comes_and_bodies_are_of_the_simulators() -> None:
    assert parse_plan(SMALL).wind == (0.0, 0.0)
    for speed, origin, velocity in ((5, 0, (0, -5)), (5, 90, (-5, 0)), (10, 210, (5, 75**0.5))):
        wind = {"site.wind": {"speed": speed, "from": origin}, "vehicle.max_airspeed": 40}
        assert parse_plan(edited(SMALL, wind)).wind == pytest.approx(velocity, abs=1e-9)
    for autopilot, sitl in (("ardupilot", ARDUCOPTER_BODY), ("px4", PX4_BODY)):
        own = {"vehicle.autopilot": autopilot}
        for same in ("sitl", None, {}, {"lag": sitl.lag}):
            plan = parse_plan(edited(SMALL, own | {"vehicle.body": same}))
            assert (plan.vehicle.body, plan.body) == (None, sitl)
        windy = {"vehicle.body": {"linear_drag": 0.4}, "site.wind": {"speed": 3, "from": 4}}
        plan = parse_plan(edited(SMALL, own | windy))
        assert plan.vehicle.body == plan.body == replace(sitl, linear_drag=0.4)
    assert parse_plan(edited(SMALL, windy)).max_airspeed == pytest.approx(8.05, abs=0.01)


def test_message_names_key_value_and_what_is_accepted() -> None:
    lines = (Path(__file__).parent / "data" / "plan" / "refused.txt").read_text().splitlines()
    rows = [line.split(" | ") for line in lines if not line.startswith("#")]
    wrong = []
    for changes, *parts in rows:
        message = refused(load_yaml(f"{{{changes}}}", changes))
        missing = [part for part in parts if part not in message]
        if missing or not message.startswith("small.yaml: ") or "\n" in message:
            wrong.append((changes, missing, message))
    assert wrong == []
    assert len(rows) > 70


def test_what_fences_mean_and_that_plans_stand_without_their_files(tmp_path: Path) -> None:
    zones = [{"center": [0, 50], "radius": 40}, {"center": [50, 0], "radius": 40}]
    fence = {"fence": {"inclusion": zones, "margin": 0}}
    assert "outside the inclusions" in refused(fence)
    plan = parse_plan(edited(SMALL, {**fence, "vehicle.autopilot": "px4"}))
    assert plan.keep_in is not None
    assert plan.keep_in.covers(np.array([[0.0, 50.0], [50.0, 0.0], [90.0, 90.0]])).tolist() == [
        True, True, False,
    ]  # fmt: skip
    place = {"latitude": 47.3965, "longitude": 8.5435, "elevation": 0}
    path = "tests/data/missions/fence_and_rally.plan"
    plan = parse_plan(edited(SMALL, {"site.origin": place, "fence": {"file": path, "margin": 2}}))
    again = parse_plan(plan.text, "elsewhere/plan.yaml")
    assert "fence_and_rally" not in plan.text
    assert again.fence is not None
    assert again.fence.margin == 2
    assert again.keep_in is not None
    assert plan.keep_in is not None
    assert again.keep_in.shape.symmetric_difference(plan.keep_in.shape).area < 1e-3
    square = [[8.54, 47.39], [8.55, 47.39], [8.55, 47.4], [8.54, 47.4]]
    shape = {"type": "MultiPolygon", "coordinates": [[square], []]}
    drawn = {"type": "Feature", "properties": {"name": "field"}, "geometry": shape}
    (tmp_path / "drawn.geojson").write_text(json.dumps(drawn))
    beside = {"site.origin": place, "fence": {"file": "drawn.geojson", "margin": 2}}
    plan = parse_plan(edited(SMALL, beside), str(tmp_path / "plan.yaml"))
    assert plan.geofence.notes == ("geometry 'field': a polygon without corners, passed over",)


def test_defaults_of_the_relay_and_how_long_a_flight_takes() -> None:
    data = load_yaml(SMALL, "test")
    assert data["radio"].pop("causal") is False
    radio = parse_plan(dump_yaml(data)).radio
    assert (radio.causal, radio.duplex, radio.bandwidth_mhz) == (True, "full", None)
    assert radio.relay.buffer_mbytes is None
    plan = parse_plan(edited(SMALL, {"radio.bandwidth_mhz": 5}))
    assert (plan.megabits(2.0), plan.megabytes(2.0)) == (10.0, 12.5)  # 100 Mbit in 10 s
    assert parse_plan(SMALL).megabytes(2.0) is None
    # 300 m at 20 m/s take 15 s and a step at w_F; each ramp of 4 s costs 2 s more, a jump none
    far = {"flight.end": [300, 50], "flight.duration": 5}
    for start, end, bounded, needed in (
        ("hover", "hover", True, 19.5),
        ("free", "free", True, 15.5),
        ("hover", "hover", False, 18.0),
        ([20, 0], "hover", True, 17.5),
    ):
        ends = {"flight.start_velocity": start, "flight.end_velocity": end}
        changes = far | ends | {"flight.bound_first_acceleration": bounded}
        takes = f"300 m, which takes at least {needed:g} s at 20 m/s and 5 m/s^2"
        assert takes in refused(changes)
        assert parse_plan(edited(SMALL, changes | {"flight.duration": needed})).flight.slots > 30


def test_every_key_is_documented_and_its_default_is_what_a_plan_gets() -> None:
    keys = reference()
    assert all(key.description and key.accepted for key in keys.values())
    said = {key.description for key in keys.values()}
    assert [row for row in table("plan/keys.tsv") if row["means"] not in said] == []
    assert [path for path, key in keys.items() if key.required and not key.inside] == [
        "site.origin.latitude", "site.origin.longitude", "site.wind.speed", "site.wind.from",
        "vehicle.max_speed", "vehicle.max_acceleration", "vehicle.battery.capacity_wh",
        "flight.start", "flight.end",
        "flight.altitude", "flight.duration", "radio.rates.snr_db",
        "fence.inclusion.center", "fence.inclusion.radius", "fence.inclusion.polygon",
        "fence.exclusion.center", "fence.exclusion.radius", "fence.exclusion.polygon",
    ]  # fmt: skip
    written = {path: load_yaml(f"x: {key.default}", path)["x"] for path, key in keys.items()
               if key.default}  # fmt: skip
    plan = parse_plan(SMALL)
    optional = (
        "fence", "site.wind", "vehicle.battery", "vehicle.body", "vehicle.power",
        "radio.base_station.gain", "radio.ground_user.gain", "radio.rates",
    )  # fmt: skip
    own = {path for path in written if path in SMALL_KEYS or path.startswith(optional)}
    full = parse_plan(edited(SMALL, {k: v for k, v in written.items() if k not in own}))
    assert contents(full) | {"study": None} == contents(plan)


SMALL_KEYS = {"site.origin.elevation", "flight.time_step", "radio.base_station.power_dbm",
              "radio.relay.power_dbm", "radio.causal"}  # fmt: skip


def test_a_changed_plan_is_checked_and_its_text_is_its_own() -> None:
    plan = parse_plan(SMALL)
    other = plan.changed({
        "flight.altitude": np.float64(60.0),
        "flight.start": (0, 40),
        "fence.exclusion": [{"center": np.array([200.0, 200.0]), "radius": 30}],
    })  # fmt: skip
    assert (other.flight.altitude, other.flight.start) == (60, (0, 40))
    assert contents(parse_plan(other.text)) == contents(other)
    assert len(other.zones) == 1
    assert contents(Plan.from_dict(load_yaml(other.text, "x"))) == contents(other)
    assert plan.flight.altitude == 40
    for key, value in (("radio.duplex", "hlf"), ("flight.height", 6), ("flight.end", object())):
        with pytest.raises(PlanError):
            plan.changed({key: value})
    # it is not replaced past its check
    with pytest.raises(InputError, match=r"plan\.changed"):
        replace(plan, flight=replace(plan.flight, duration=60))
    assert pickle.loads(pickle.dumps(plan)) == copy.deepcopy(plan) == plan


def test_every_problem_of_a_plan_has_its_row() -> None:
    folder = Path(checks.__file__).parent
    rows = [line.split("\t") for line in (folder / "problems.tsv").read_text().splitlines()[1:]]
    source = "".join((folder / name).read_text() for name in ("checks.py", "fence.py"))
    told = re.findall(r'(?:wrong\(\s*|^        )"([\w-]+)"[:,)]', source, re.MULTILINE)
    assert {name for name, _ in rows} == set(told)
