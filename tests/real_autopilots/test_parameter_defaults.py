"""The defaults in the vehicles' tables are those of the real autopilots."""

import json
import lzma
from collections.abc import Mapping
from pathlib import Path

import pytest
from simulators import simulated

from faao_mav.autopilot import ARDUCOPTER, ARDUPLANE, PX4_COPTER, PX4_PLANE, VehicleType
from faao_mav.wire.discover import discover
from faao_mav.wire.link import WireLink
from faao_mav.wire.parameters import read_parameters
from faao_mav.wire.transfer import Peer

BY_AIRFRAME = {"NAV_ACC_RAD"}
"""PX4's airframes set these: a multicopter 2 m, a plane 10 m."""

SIMULATOR = "SIM_"
"""Begins the names of a simulator's own parameters: tables hold what real aircraft have, none."""

PATIENCE = 60.0
"""Seconds that a simulated autopilot has to start."""


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
    with (
        simulated(autopilots, program, tmp_path, bare=True) as connection,
        WireLink(connection) as link,
    ):
        (found,) = link.run(discover(patience=PATIENCE)).vehicles
        names = [tuple(parameter.names) for parameter in table.parameters.values()]
        read = link.run(read_parameters(Peer(link.address, found.address, table), names))
    assert read.missing == ()
    assert differences(table, read.values) == []


@pytest.mark.parametrize("table", [PX4_COPTER, PX4_PLANE])
def test_of_px4(table: VehicleType, autopilots: Path) -> None:
    packed = (autopilots / "px4/etc/extras/parameters.json.xz").read_bytes()
    listing = json.loads(lzma.decompress(packed))["parameters"]
    assert differences(table, {each["name"]: float(each["default"]) for each in listing}) == []
