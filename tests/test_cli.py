"""The command line, from plan to mission file."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import FLYABLE, edited
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from faao_mav.cli.main import app
from faao_mav.mission.formats import read_mission, read_mission_file
from faao_mav.mission.formats.parameter_file import read_parameters
from faao_mav.plan.yaml_text import load_yaml


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    path = tmp_path / "plan.yaml"
    path.write_text(FLYABLE)
    return path


def test_the_main_job(plan: Path, tmp_path: Path) -> None:
    out, save = tmp_path / "m.waypoints", tmp_path / "r.npz"
    result = run(plan, "--out", out, "--save", save)
    assert result.exit_code == 0, result.output
    assert result.stderr == ""
    assert re.match(r"delivers 1\.\d+ bit/s/Hz for 10 s; the mission keeps \d+", result.stdout)
    assert "converged after" not in result.stdout
    assert str(out) in result.stdout
    mission = read_mission(out)
    assert mission.home is not None
    assert [item.command for item in mission.items][:3] == [22, 178, 16]
    assert mission.items[-1].command == 20
    with np.load(save) as archive:
        assert archive["w"].shape == (20, 2)
        assert archive["predicted_t"].shape == archive["predicted_w"].shape[:1]
    names = sorted(p.name for p in tmp_path.iterdir())
    assert names == ["m.param", "m.waypoints", "plan.yaml", "r.npz"]
    parameters = read_parameters(tmp_path / "m.param")
    assert parameters["WPNAV_ACCEL"] == pytest.approx(100 * parameters["WP_ACC"])


def test_the_mission_as_a_plan_of_qgroundcontrol_is_the_same(plan: Path, tmp_path: Path) -> None:
    plan.write_text(edited(FLYABLE, {"vehicle.autopilot": "px4"}))
    for name in ("m.waypoints", "m.plan", "m.kml"):
        assert run(plan, "--out", tmp_path / name, "--quiet").output == ""
    read = read_mission_file(tmp_path / "m.plan")
    assert (read.firmware, read.vehicle_type) == (12, 2)
    assert read.mission == read_mission(tmp_path / "m.waypoints")
    assert "<LineString>" in (tmp_path / "m.kml").read_text()


def test_json_is_one_object_with_the_promised_keys(plan: Path, tmp_path: Path) -> None:
    plan.write_text(edited(FLYABLE, {"radio.fading": "ergodic"}))
    result = run(plan, "--out", tmp_path / "m.txt", "--json")
    assert result.exit_code == 0
    assert result.stdout.count("\n") == 1
    data = json.loads(result.stdout)
    assert data["average_rate"] == min(data["rate_bs_uav"], data["rate_uav_user"])
    assert data["average_rate"] < data["mutual_information"] < 2
    assert data["upper_bound"] is None
    assert data["fresh_rate"] == pytest.approx(data["average_rate"], abs=0.1)
    assert 0 < data["fresh_rate_error"] < 0.05
    assert data["starts"]["straight"] <= data["average_rate"] + 1e-3
    assert data["iterations"] == len(data["history"]) - 1
    assert 0 < data["seconds"]["optimize"] <= data["seconds"]["total"]
    assert data["saturated"] is False
    assert data["mission"]["items"] == len(read_mission(tmp_path / "m.txt").items)
    assert data["mission"]["duration"] == data["predicted"]["duration"] > 9
    assert 0 < data["predicted"]["average_rate"] < 2
    assert data["predicted"]["rms_position_error"] <= data["predicted"]["max_position_error"]
    assert data["mission"]["distance"] > 70
    assert max(data["residuals"].values()) < 1e-6
    assert data["upload"] is None
    assert {"rule", "item", "level", "message", "action"} <= data["validation"][0].keys()


@pytest.mark.usefixtures("coarse_map")
def test_bound_and_algorithm_1_by_option(plan: Path) -> None:
    plan.write_text(edited(FLYABLE, {"radio.fading": "ergodic", "radio.fading_samples": 4}))
    data = json.loads(run(plan, "--bound", "--json").stdout)
    assert data["average_rate"] <= data["upper_bound"] <= 2
    assert data["upper_bound_exact"] is False
    plan.write_text(edited(FLYABLE, {"radio.fading": "realization"}))
    data = json.loads(run(plan, "--method", "algorithm1", "--json").stdout)
    assert (data["fresh_rate"], data["starts"]) == (None, {})
    assert "less than 0.0001" in data["ending"]


def test_a_good_plan_without_a_mission_exits_with_1_and_keeps_what_is_there(
    plan: Path, tmp_path: Path
) -> None:
    out, save = tmp_path / "m.txt", tmp_path / "r.npz"
    out.write_text("precious")
    plan.write_text(edited(FLYABLE, {"mission.max_items": 4}))
    result = run(plan, "--out", out, "--save", save)
    assert result.exit_code == 1
    assert "mission.max_items" in result.stderr
    assert save.exists()
    assert out.read_text() == "precious"


def test_as_a_program(plan: Path, tmp_path: Path) -> None:
    """The installed script: progress off a terminal stays silent, errors are one line."""
    script = Path(sys.executable).with_name("faao-mission")
    good = subprocess.run([script, plan, "--json"], capture_output=True, text=True, check=False)
    assert (good.returncode, good.stderr) == (0, "")
    json.loads(good.stdout)
    bad = subprocess.run(
        [script, tmp_path / "no.yaml"], capture_output=True, text=True, check=False
    )
    assert bad.returncode == 2
    where = tmp_path / "no.yaml"
    assert bad.stderr == f"faao-mission: {where}: cannot be read: No such file or directory\n"


def test_output_that_cannot_be_written_or_shown(tmp_path: Path) -> None:
    script = Path(sys.executable).with_name("faao-mission")
    mission = tmp_path / "ü.waypoints"
    mission.write_text("QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t47\t8\t400\t1\n")
    if Path("/dev/full").exists():
        with Path("/dev/full").open("w") as full:
            done = subprocess.run(
                [script, "validate", mission], stdout=full, stderr=subprocess.PIPE, text=True
            )
        assert done.returncode == 2
        assert done.stderr == (
            "faao-mission: standard output: cannot be used: No space left on device\n"
        )
    ascii_only = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(
        [script, "validate", mission], capture_output=True, text=True, env=ascii_only
    )
    assert (done.returncode, done.stderr) == (1, "")
    assert "\\xfc.waypoints: 0 items" in done.stdout


def test_names_that_are_no_unicode(plan: Path, tmp_path: Path) -> None:
    name = os.fsdecode(b"m\xff")
    assert run(plan, "--quiet", "--out", tmp_path / f"{name}.waypoints").exit_code == 0
    assert (tmp_path / f"{name}.param").read_text().startswith("# for m?.waypoints")


TINY = edited(FLYABLE, {"flight.duration": 3, "flight.end": [5, 45], "optimizer.max_iterations": 1})
VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 300) | st.integers(-(10**20), 10**20),
    st.floats(-500, 500) | st.sampled_from([float("nan"), float("inf")]),
    st.sampled_from(["hover", "free", "qpsk", "none", "all_ones", "mrt", "land", ""])
    | st.text(max_size=8),
    st.lists(st.floats(-20, 20), max_size=3),
    st.dictionaries(st.sampled_from(["latitude", "longitude", "x"]), st.floats(), max_size=3),
)


@st.composite
def mutations(draw: st.DrawFn) -> dict[str, Any]:
    paths = [
        f"{section}.{key}"
        for section, keys in load_yaml(TINY, "test").items()
        for key in [*keys, "extra"]
    ]
    paths += ["radio.relay.power_dbm", "radio.relay.antennas", "radio.modulation", "radio.fading",
              "radio.seed", "optimizer.precoder", "mission.on_finish", "mission.path_tolerance",
              "flight.start_velocity", "mission.max_items", "vehicle.parameters"]  # fmt: skip
    changes = draw(st.dictionaries(st.sampled_from(paths), VALUES, min_size=1, max_size=3))
    # a section that is replaced has no keys to change
    return {
        path: value
        for path, value in changes.items()
        if not any(path.startswith(f"{other}.") for other in changes)
    }


@settings(max_examples=30)
@given(mutations())
def test_no_mutation_gives_a_traceback_or_a_partial_file(
    tmp_path_factory: pytest.TempPathFactory, changes: dict[str, Any]
) -> None:
    folder = tmp_path_factory.mktemp("fuzz")
    plan, out = folder / "plan.yaml", folder / "m.waypoints"
    plan.write_text(edited(TINY, changes))
    result = run(plan, "--out", out, "--json")
    assert result.exception is None or isinstance(result.exception, SystemExit)
    assert result.exit_code in (0, 1, 2)
    assert "Traceback" not in result.output
    if result.exit_code == 0 or result.stdout:
        assert result.exit_code < 2
        json.loads(result.stdout)
        assert read_mission(out).items
        written = {p.name for p in folder.iterdir()}
        assert written - {"m.param"} == {"m.waypoints", "plan.yaml"}
    else:
        assert result.stdout == ""
        assert result.stderr
        assert [p.name for p in folder.iterdir()] == ["plan.yaml"]


def test_a_plan_is_piped_in(tmp_path: Path) -> None:
    out = tmp_path / "m.waypoints"
    result = CliRunner().invoke(app, ["-", "--out", str(out), "--quiet"], input=FLYABLE)
    assert (result.exit_code, result.stderr) == (0, "")
    assert read_mission(out).items
