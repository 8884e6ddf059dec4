"""The defaults in the vehicles' tables are those of the real autopilots."""

import json
import lzma
import time
from collections.abc import Mapping
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
"""Seconds that a simulated autopilot has to start, and to list its parameters."""


def listed(connection: str) -> Mapping[str, float]:
    """Return the parameters of the vehicle at `connection`."""
    end = time.monotonic() + PATIENCE
    link = mavutil.mavlink_connection(connection)
    link.wait_heartbeat(timeout=PATIENCE)
    link.mav.param_request_list_send(link.target_system, link.target_component)
    found: dict[str, float] = {}
    left: set[int] | None = None  # of the numbers of all parameters; some packets are lost
    while left is None or left:
        message = link.recv_match(type="PARAM_VALUE", blocking=True, timeout=1)
        if message is not None:
            left = set(range(message.param_count)) if left is None else left
            left.discard(message.param_index)
            found[message.param_id] = message.param_value
            continue
        assert time.monotonic() < end, "it does not list its parameters"
        if left is None:
            link.mav.param_request_list_send(link.target_system, link.target_component)
        for index in sorted(left or ())[:50]:
            link.mav.param_request_read_send(link.target_system, link.target_component, b"", index)
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
    ("program", "vehicle_type"), [("arducopter", ARDUCOPTER), ("arduplane", ARDUPLANE)]
)
def test_of_ardupilot(
    program: str, vehicle_type: VehicleType, autopilots: Path, tmp_path: Path
) -> None:
    with simulated(autopilots, program, tmp_path, bare=True) as connection:
        real = listed(connection)
    assert differences(vehicle_type, real) == []
    for parameter in vehicle_type.parameters.values():
        assert set(parameter.names) & set(real), parameter.key


@pytest.mark.parametrize("vehicle_type", [PX4_COPTER, PX4_PLANE])
def test_of_px4(vehicle_type: VehicleType, autopilots: Path) -> None:
    packed = (autopilots / "px4/etc/extras/parameters.json.xz").read_bytes()
    listing = json.loads(lzma.decompress(packed))["parameters"]
    real = {each["name"]: float(each["default"]) for each in listing}
    assert differences(vehicle_type, real) == []
