"""The defaults in the vehicles' tables are those of the real autopilots."""

import json
import lzma
from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest
from pymavlink import mavutil
from simulators import simulated

from faao_mav.autopilot import ARDUCOPTER, ARDUPLANE, PX4_COPTER, PX4_PLANE, VehicleType

BY_AIRFRAME = {"NAV_ACC_RAD"}
"""PX4's airframes set these: a multicopter 2 m, a plane 10 m."""

SIMULATOR = "SIM_"
"""Begins the names of a simulator's own parameters: tables hold what real aircraft have, none."""

PATIENCE = 60.0
"""Seconds that a simulated autopilot has to start."""


def read(connection: str, names: Iterable[str]) -> Mapping[str, float]:
    """Return those of `names` that the vehicle at `connection` has: not as our own client reads."""
    link = mavutil.mavlink_connection(connection)
    link.wait_heartbeat(timeout=PATIENCE)
    for name in (name for name in names for _ in range(3)):  # some packets are lost
        if name not in link.params:
            link.param_fetch_one(name)
            link.recv_match(type="PARAM_VALUE", blocking=True, timeout=0.3)
    found = dict(link.params)
    link.close()
    return found


def differences(vehicle_type: VehicleType, real: Mapping[str, float]) -> list[str]:
    """Return where the table's defaults are not the `real` ones; aliases of others are left out."""
    return [
        f"{name}: {parameter.default / unit:g} in the table, {real[name]:g} on the vehicle"
        for parameter in vehicle_type.parameters.values()
        for name, unit in parameter.names.items()
        if name in real
        and name not in BY_AIRFRAME
        and not name.startswith(SIMULATOR)
        and real[name] * unit != pytest.approx(parameter.default, rel=1e-5)
    ]


@pytest.mark.parametrize(
    ("program", "table"), [("arducopter", ARDUCOPTER), ("arduplane", ARDUPLANE)]
)
def test_of_ardupilot(program: str, table: VehicleType, autopilots: Path, tmp_path: Path) -> None:
    names = [{*parameter.names} for parameter in table.parameters.values()]
    with simulated(autopilots, program, tmp_path, bare=True) as connection:
        real = read(connection, sorted(set().union(*names)))
    assert [each for each in names if not each & {*real}] == []
    assert differences(table, real) == []


@pytest.mark.parametrize("table", [PX4_COPTER, PX4_PLANE])
def test_of_px4(table: VehicleType, autopilots: Path) -> None:
    packed = (autopilots / "px4/etc/extras/parameters.json.xz").read_bytes()
    listing = json.loads(lzma.decompress(packed))["parameters"]
    assert differences(table, {each["name"]: float(each["default"]) for each in listing}) == []
