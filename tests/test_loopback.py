"""From the plan to the vehicle and back: planned, uploaded, flown by the mock, priced."""

import json
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from conftest import MISSIONS, edited, free_port
from pymavlink import mavutil
from typer.testing import CliRunner

from faao_mav import download
from faao_mav.cli.main import app
from faao_mav.geodesy import LocalFrame
from faao_mav.mavlink.mock import MockAutopilot, behaviour_of
from faao_mav.mavlink.mock.serve import predicted, running
from faao_mav.mission.formats import read_mission
from faao_mav.mission.formats.parameter_file import read_parameters
from faao_mav.mission.item import Home, Mission
from faao_mav.optimizer.solution import load_solution
from faao_mav.validate.comparison import compare_with_plan
from faao_mav.vehicle import Track, Vehicle
from faao_mav.vehicle.files import parameter_path

HOME = Home(-35.363262, 149.165237, 584.0)
SPEEDUP, RATE = 40.0, 80.0

SHORTER: dict[str, Any] = {
    "flight.start": [0, 100],
    "flight.end": [100, 0],
    "flight.altitude": 40,
    "flight.duration": 40,
    "flight.time_step": 1,
    "radio.ground_user.position": [120, 120],
    "radio.base_station.power_dbm": 0,
    "radio.relay.power_dbm": 0,
    "radio.fading_samples": 8,
}
"""Of `missions/copter_relay.yaml`: half a minute of flight, timed in seconds for PX4 too."""

ARM, START = 400, 300


@dataclass
class Observed:
    """What a ground station saw of a flight: times of the flight, s; degrees; metres."""

    t: list[float] = field(default_factory=list)
    place: list[tuple[float, float]] = field(default_factory=list)
    up: list[float] = field(default_factory=list)
    reached: dict[int, float] = field(default_factory=dict)

    def track(self, items: int, first: int) -> Track:
        """Return it as a track; `first` is the number that the vehicle gives the first item."""
        frame = LocalFrame(HOME.latitude, HOME.longitude)
        latitude, longitude = np.array(self.place).T
        position = np.column_stack([frame.to_local(latitude, longitude), self.up])
        t = np.array(self.t) - self.t[0]
        reached = np.full(items, np.nan)
        for number, when in self.reached.items():
            reached[number - first] = when - self.t[0]
        still = np.zeros_like(position)
        return Track(t, position, still, np.zeros(len(t), dtype=int), reached, frame)


def watch(port: int, until: int) -> Observed:
    """Arm, start the mission, and listen until the vehicle has reached item `until`."""
    station = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=255)
    found, end = Observed(), time.monotonic() + 30
    try:
        station.mav.heartbeat_send(6, 8, 0, 0, 4)
        for command in (ARM, START):
            station.mav.command_long_send(1, 1, command, 0, 1, 0, 0, 0, 0, 0, 0)
            ack = station.recv_match(type="COMMAND_ACK", blocking=True, timeout=5)
            assert (ack.command, ack.result) == (command, 0)
        while until not in found.reached and time.monotonic() < end:
            message = station.recv_match(
                type=["GLOBAL_POSITION_INT", "MISSION_ITEM_REACHED"], blocking=True, timeout=1
            )
            if message is None:
                continue
            if message.get_type() == "MISSION_ITEM_REACHED" and found.t:
                found.reached[message.seq] = found.t[-1]
            elif message.get_type() == "GLOBAL_POSITION_INT":
                found.t.append(message.time_boot_ms / 1000 * SPEEDUP)
                found.place.append((message.lat / 1e7, message.lon / 1e7))
                found.up.append(message.relative_alt / 1000)
    finally:
        station.close()
    assert until in found.reached
    return found


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_what_is_planned_is_what_the_vehicle_delivers(
    kind: Literal["ardupilot", "px4"], tmp_path: Path
) -> None:
    plan, out, save = (tmp_path / name for name in ("plan.yaml", "m.waypoints", "r.npz"))
    text = (MISSIONS / "copter_relay.yaml").read_text()
    plan.write_text(edited(text, SHORTER | {"vehicle.autopilot": kind}))
    tuned, port = parameter_path(out, kind), free_port()

    def fly(mission: Mission) -> Track:
        return predicted(Vehicle(kind, parameters=read_parameters(tuned)))(mission)

    mock = MockAutopilot(
        behaviour_of(kind), home=HOME, fly=fly, speedup=SPEEDUP, rate=RATE, beat=0.1
    )
    with running(mock, f"udpin:127.0.0.1:{port}"):
        connection = f"udpout:127.0.0.1:{port}"
        arguments = (plan, "--out", out, "--save", save, "--upload", connection, "--json")
        result = CliRunner().invoke(app, [str(argument) for argument in arguments])
        assert result.exit_code == 0, result.output
        told = json.loads(result.stdout)
        assert told["upload"]["verified"] is True
        assert [each for each in told["validation"] if each["level"] != "note"] == []

        mission, vehicle = read_mission(out), Vehicle(kind)
        assert download(connection).items == tuple(map(vehicle.type.dialect.stored, mission.items))

        first = int(kind == "ardupilot")  # whose item 0 is home
        seen = watch(port, len(mission.items) - 2 + first)
    found = compare_with_plan(load_solution(save), seen.track(len(mission.items), first))
    assert found.predicted_rate == pytest.approx(told["predicted"]["average_rate"], rel=0.01)
    assert found.predicted_rate == pytest.approx(told["average_rate"], rel=0.02)
    assert found.rms_position_error < told["predicted"]["rms_position_error"] + 1
    assert found.altitude_error < 0.1
