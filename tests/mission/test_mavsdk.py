"""MAVSDK, an independent client, reads the files."""

import math
import socket
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from mavsdk.component_type import ComponentType
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.mission_raw import MissionRaw
from pymavlink import mavutil
from relay_flights import dash_hover_dash, mission_of, plan_with

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.files import plan_target
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.fence import Circle, Fence, Polygon, RallyPoint
from faao_mav.mission.formats import read_mission, write_qgc_plan

DATA = Path(__file__).parent.parent / "data" / "missions"


def free_endpoint() -> str:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{probe.getsockname()[1]}"


@pytest.fixture(scope="module", params=["px4", "ardupilot"])
def client(request: pytest.FixtureRequest) -> Iterator[tuple[str, MissionRaw]]:
    """MAVSDK, connected to nothing but heartbeats: its importer wants to know the autopilot."""
    mavlink = mavutil.mavlink
    kind = {"px4": mavlink.MAV_AUTOPILOT_PX4, "ardupilot": mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA}
    stop = threading.Event()
    endpoint = free_endpoint()

    def beat() -> None:
        while not stop.wait(0.1):
            vehicle.mav.heartbeat_send(mavlink.MAV_TYPE_QUADROTOR, kind[request.param], 0, 0, 4)

    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    vehicle = mavutil.mavlink_connection(
        f"udpout:{endpoint}", source_system=1, source_component=mavlink.MAV_COMP_ID_AUTOPILOT1
    )
    thread = threading.Thread(target=beat, daemon=True)
    try:
        sdk.add_any_connection(f"udpin://{endpoint}")
        thread.start()
        system = sdk.first_autopilot(10.0)
        assert system is not None, "MAVSDK saw no heartbeat in 10 s"
        yield request.param, MissionRaw(system)
    finally:
        stop.set()
        if thread.is_alive():
            thread.join()
        sdk.destroy()
        vehicle.close()


def assert_same(rows: Sequence[Any], items: Sequence[MissionItem]) -> None:
    for row, item in zip(rows, items, strict=True):
        assert (row.command, row.frame) == (item.command, item.frame)
        params = (row.param1, row.param2, row.param3, row.param4)
        assert params == pytest.approx(item.params, nan_ok=True)
        scale = 1 if item.frame == 2 else 1e7
        assert abs(row.x - item.x * scale) <= 1
        assert abs(row.y - item.y * scale) <= 1
        assert row.z == pytest.approx(item.z)
        assert row.autocontinue == item.autocontinue


def test_mavsdk_imports_the_plan(client: tuple[str, MissionRaw]) -> None:
    autopilot, raw = client
    planned = mission_of(*dash_hover_dash(), plan_with(autopilot=autopilot))
    pause = MissionItem(16, 3, (2.5, 0.0, 0.0, math.nan), 47.0, 8.0, 30.0, autocontinue=False)
    yaw = math.nan if autopilot == "px4" else 0.0
    mission = Mission(
        (*planned.items, pause, MissionItem(177, 2, (3.0, 2.0, 0.0, 0.0))),
        Home(47.397742, 8.545594, 488.25),
        Fence(
            (Polygon(((47.0, 8.0), (47.5, 8.0), (47.5, 8.5)), True),),
            (Circle((47.25, 8.125), 12.5, False),),
        ),
        (RallyPoint(47.25, 8.25, 40.0), RallyPoint(47.125, 8.125, 30.0)),
    )
    text = write_qgc_plan(mission, plan_target(Vehicle(autopilot)))
    imported = raw.import_qgroundcontrol_mission_from_string(text)

    rows = imported.mission_items
    if autopilot == "ardupilot":  # it puts the planned home before them
        home, *rows = rows
        assert (home.command, home.x, home.y, home.z) == (16, 473977420, 85455940, 488.25)
    *most, last, jump = rows
    assert_same(most, planned.items)
    assert (last.param1, last.autocontinue) == (2.5, 0)
    assert last.param4 == pytest.approx(yaw, nan_ok=True)
    assert (jump.command, jump.param1, jump.param2) == (177, 3, 2)

    fence = [(row.command, row.frame, row.param1, row.x) for row in imported.geofence_items]
    assert fence == [
        (5001, 0, 3, 470000000),
        (5001, 0, 3, 475000000),
        (5001, 0, 3, 475000000),
        (5004, 0, 12.5, 472500000),
    ]
    rally = [(row.command, row.frame, row.x, row.y, row.z) for row in imported.rally_items]
    assert rally == [
        (5100, 3, 472500000, 82500000, 40),
        (5100, 3, 471250000, 81250000, 30),
    ]


@pytest.mark.parametrize("name", ["px4.plan", "survey.plan", "fence_and_rally.plan"])
def test_plans_of_the_corpus_are_read_as_mavsdk_reads_them(
    client: tuple[str, MissionRaw], name: str
) -> None:
    autopilot, raw = client
    mission = read_mission(DATA / name)
    rows = raw.import_qgroundcontrol_mission_from_string((DATA / name).read_text()).mission_items
    assert_same(rows[autopilot == "ardupilot" :], mission.items)
