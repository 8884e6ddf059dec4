"""MAVSDK, an independent client, reads the files."""

import socket
import threading
from collections.abc import Iterator

import pytest
from mavsdk.component_type import ComponentType
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.mission_raw import MissionRaw
from pymavlink import mavutil
from relay_flights import dash_hover_dash, mission_of, plan_with

from faao_mav.mission.formats import write_wpl


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


def test_mavsdk_imports_the_mission(client):
    autopilot, raw = client
    mission = mission_of(*dash_hover_dash(), plan_with(autopilot=autopilot))
    imported = raw.import_mission_planner_mission_from_string(write_wpl(mission)).mission_items
    # It keeps row 0 as an item, and for ArduPilot puts another before it.
    rows = imported[-len(mission.items) - 1 :]
    assert len(imported) - len(rows) == (1 if autopilot == "ardupilot" else 0)

    home = rows[0]
    assert (home.command, home.frame) == (16, 0)
    assert (home.x, home.y) == (round(mission.home.latitude * 1e7), 1491652370)
    assert home.z == mission.home.altitude
    for row, item in zip(rows[1:], mission.items, strict=True):
        assert (row.command, row.frame) == (item.command, item.frame)
        assert (row.param1, row.param2, row.param3, row.param4) == pytest.approx(item.params)
        scale = 1 if item.frame == 2 else 1e7
        assert abs(row.x - item.x * scale) <= 1
        assert abs(row.y - item.y * scale) <= 1
        assert row.z == pytest.approx(item.z)
        assert row.autocontinue == 1
