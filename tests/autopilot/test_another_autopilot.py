"""A third autopilot is one `VehicleType` and one call of `register`: nothing else names it."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from conftest import MISSIONS, SHORT, edited, free_port
from served import running
from typer.testing import CliRunner

from faao_mav.autopilot import (
    AutopilotFamily,
    Vehicle,
    VehicleType,
    register,
    unregister,
    vehicle_type_by_numbers,
)
from faao_mav.autopilot.dialect import ALL, Dialect, Limit, SpeedChange
from faao_mav.autopilot.files import autopilot_of, parameter_path
from faao_mav.autopilot.manners import Modes
from faao_mav.autopilot.parameter import Parameter, ParameterValues, Recommended, table
from faao_mav.autopilot.px4.flight_model import Px4
from faao_mav.cli.main import app
from faao_mav.errors import PlanError
from faao_mav.mission.command import Command, Frame
from faao_mav.mission.formats.parameter_file import render_parameters
from faao_mav.mission.item import MissionItem
from faao_mav.plan import parse_plan
from faao_mav.sim import MockAutopilot, behaviour_of
from faao_mav.validate import check
from faao_mav.workflow import plan_mission

TOY = AutopilotFamily(
    key="toy",
    name="ToyPilot",
    mav_autopilot=99,
    parameter_suffix=".toy",
    parameter_style="list",
    parameter_prefixes=("TOY_",),
)

TABLE = table(
    Parameter("cruise_speed", "m/s", 6.0, {"TOY_SPEED": 1.0, "TOY_SPEED_KMH": 1 / 3.6}, 0.5),
    Parameter("acceleration", "m/s^2", 4.0, {"TOY_ACCEL": 1.0}, 0.5),
    Parameter("climb_speed", "m/s", 2.0, {"TOY_CLIMB": 1.0}, 0.5),
    Parameter("descent_speed", "m/s", 1.0, {"TOY_SINK": 1.0}, 0.5),
    Parameter("return_height", "m", 20.0, {"TOY_RTL": 1.0}, 0.0),
)


def model(vehicle: ParameterValues, _: float | None) -> Px4:
    """It flies like something that is known, at its own speed and acceleration."""
    speed, acceleration = vehicle.value("cruise_speed"), vehicle.value("acceleration")
    return Px4(cruise_speed=speed, acceleration=acceleration, jerk=20.0, error_limit=10.0)


COPTER = VehicleType(
    family=TOY,
    kind="copter",
    name="ToyCopter",
    mav_types=(2,),
    modes=Modes(rest=0, mission=1, hold=2),
    hovers=True,
    parameters=TABLE,
    dialect=Dialect(
        name="ToyCopter",
        home_row=False,
        items=Limit(500, 500),
        jumps=None,
        fence_rows=10,
        rally_rows=1,
        atomic=True,
        unset_is_zero=False,
        zero_means_here=False,
        placed=dict.fromkeys((Command.NAV_WAYPOINT, Command.NAV_TAKEOFF, Command.NAV_LAND), ALL),
        unplaced=dict.fromkeys((Command.NAV_RETURN_TO_LAUNCH, Command.DO_CHANGE_SPEED), ALL),
        frames={3: 3, 6: 3},
        idle_frames={2: 2},
        speed_change=lambda item: SpeedChange("horizontal", item.params[1]),
    ),
    flight_model=model,
    recommendation=Recommended(5.0, (0.5, 6.0)),
)

PLAN = edited(
    (MISSIONS / "copter_relay.yaml").read_text(),
    SHORT | {"vehicle.autopilot": "toy", "radio.fading_samples": 4},
)


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    register(COPTER)
    yield
    unregister(COPTER)


def test_its_files_and_numbers_are_known_while_it_is() -> None:
    assert parameter_path(MISSIONS / "x.plan", "toy").name == "x.toy"
    assert autopilot_of({"TOY_SPEED": 1.0}) == "toy"
    assert render_parameters({"TOY_SPEED": 8.0}, TOY.parameter_style) == "TOY_SPEED,8\n"
    assert vehicle_type_by_numbers(99, 2) is COPTER
    assert Vehicle("toy", "copter", {"TOY_SPEED_KMH": 36}).value("cruise_speed") == 10
    unregister(COPTER)
    try:
        with pytest.raises(PlanError, match=r"vehicle\.autopilot: 'toy' is not accepted"):
            parse_plan(PLAN)
    finally:
        register(COPTER)


def test_a_mission_is_made_and_judged_by_its_dialect_and_table_and_flown(tmp_path: Path) -> None:
    plan = parse_plan(PLAN)
    assert plan.aircraft.type is COPTER
    result = plan_mission(plan)
    conversion, found = result.conversion, result.check
    assert conversion is not None
    assert found is not None
    assert conversion.parameters in plan.candidates
    assert conversion.parameters["TOY_SPEED"] == 8.0
    assert conversion.schedule.deviation.rms < 3
    assert found.track is not None
    assert found.track.position[:, 2].max() == pytest.approx(40, abs=1)
    assert [f.rule for f in found.findings if f.level == "error"] == []
    assert not [f for f in found.findings if f.rule.startswith(("px4", "ardupilot"))]
    spline = MissionItem(Command.NAV_SPLINE_WAYPOINT, Frame.GLOBAL_RELATIVE_ALT, x=47, y=8, z=30)
    mission = conversion.mission
    judged = check(replace(mission, items=(*mission.items, spline)), Vehicle("toy"))
    assert "refused-on-upload" in {finding.rule for finding in judged.findings}
    full = check(replace(mission, items=mission.items * 99), Vehicle("toy"))
    message = next(f.message for f in full.findings if f.rule == "storage-full")
    assert message.endswith("ToyCopter stores 500 at most (NO_SPACE)")

    path, *_ = result.write(tmp_path / "m.plan")
    assert mission.home is not None
    mock = MockAutopilot(behaviour_of("px4", family=TOY), home=mission.home, beat=0.1, speedup=50.0)
    to = f"127.0.0.1:{free_port()}"
    with running(mock, f"udpin:{to}"):
        tuned = ("--parameters", path.with_suffix(".toy"))
        for command in (("upload", path, *tuned), ("fly", path, "--arm", "--json")):
            arguments = [str(each) for each in (*command, "--to", f"udpout:{to}")]
            done = CliRunner().invoke(app, arguments)
            assert done.exit_code == 0, done.output
    assert json.loads(done.stdout.splitlines()[-1])["ending"] == "finished"
    assert not mock.armed
