"""MAVSDK, written by others: its client against our mock, our client against its server."""

import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from conftest import free_port
from mavsdk.component_type import ComponentType
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.mission_raw import MissionItem as SdkItem
from mavsdk.plugins.mission_raw import MissionRaw
from mavsdk.plugins.mission_raw_server import MissionRawServer
from mock_flights import fly
from served import running
from stations import FENCE, HOME, RALLY, a_mission, places

from faao_mav.sim import MockAutopilot, MockKind, behaviour_of
from faao_mav.wire import upload
from faao_mav.wire.messages import WireItem
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.wire_items import wire_items


def sdk_items(rows: tuple[WireItem, ...], part: MissionType) -> list[SdkItem]:
    return [
        SdkItem(
            seq,
            row.frame,
            row.command,
            row.current if part is MissionType.MISSION else int(seq == 0),
            row.autocontinue,
            *row.params,
            row.x,
            row.y,
            row.z,
            int(part),
        )
        for seq, row in enumerate(rows)
    ]


def found_places(items: list[SdkItem]) -> list[tuple[int, int, int, float]]:
    return [(item.command, item.x, item.y, item.z) for item in items]


@pytest.fixture(scope="module", params=["ardupilot", "px4"])
def flown(request: pytest.FixtureRequest) -> Iterator[tuple[MockAutopilot, MissionRaw]]:
    kind: MockKind = request.param
    port = free_port()
    mock = MockAutopilot(behaviour_of(kind), home=HOME, fly=fly, beat=0.1, speedup=40.0)
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        with running(mock, f"udpout:127.0.0.1:{port}"):
            system = sdk.first_autopilot(10.0)
            assert system is not None, "MAVSDK saw no heartbeat in 10 s"
            raw = MissionRaw(system)
            raw.system = system
            yield mock, raw
    finally:
        sdk.destroy()


def test_mavsdk_uploads_downloads_and_clears_a_mission(flown: Any) -> None:
    mock, client = flown
    rows = wire_items(a_mission(8), MissionType.MISSION, mock.vehicle)
    client.upload_mission(sdk_items(rows, MissionType.MISSION))
    assert places(mock.lists.items(MissionType.MISSION)) == places(rows)
    assert found_places(client.download_mission()) == places(rows)
    client.clear_mission()
    assert mock.mission().items == ()


def test_mavsdk_uploads_and_downloads_a_fence_and_rally_points(flown: Any) -> None:
    mock, client = flown
    mission = a_mission(3, fence=FENCE, rally=RALLY)
    fence, rally = (
        wire_items(mission, part, mock.vehicle) for part in (MissionType.FENCE, MissionType.RALLY)
    )
    client.upload_geofence(sdk_items(fence, MissionType.FENCE))
    client.upload_rally_points(sdk_items(rally, MissionType.RALLY))
    assert (mock.mission().fence, mock.mission().rally) == (FENCE, RALLY)
    assert found_places(client.download_geofence()) == places(fence)
    assert found_places(client.download_rallypoints()) == places(rally)


def test_mavsdk_arms_and_flies_the_mission(flown: Any) -> None:
    mock, client = flown
    rows = wire_items(a_mission(8), MissionType.MISSION, mock.vehicle)
    client.upload_mission(sdk_items(rows, MissionType.MISSION))
    reached = threading.Event()

    def progress(now: Any, _: object) -> None:
        if now.current == len(rows) - 1:
            reached.set()

    handle = client.subscribe_mission_progress(progress)
    Action(client.system).arm()
    assert mock.armed
    client.start_mission()
    assert reached.wait(30)
    client.unsubscribe_mission_progress(handle)
    for _ in range(200):
        if not mock.armed:
            break
        time.sleep(0.1)
    assert not mock.armed, "it has not landed"


def test_our_client_uploads_to_mavsdks_server() -> None:
    port = free_port()
    received: list[list[SdkItem]] = []
    arrived = threading.Event()

    def incoming(result: object, plan: Any, _: object) -> None:
        received.append(plan.mission_items)
        arrived.set()

    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.AUTOPILOT))
    try:
        sdk.add_any_connection(f"udpout://127.0.0.1:{port}")
        component = sdk.server_component()
        server = MissionRawServer(component)
        server.subscribe_incoming_mission(incoming)
        mission = a_mission(8)
        report = upload(mission, f"udpin:127.0.0.1:{port}", system=1)
        assert arrived.wait(5)
        assert report.verified
        assert report.vehicle.autopilot == "generic"
        assert found_places(received[0]) == places(
            wire_items(mission, MissionType.MISSION, report.vehicle.vehicle)
        )
        server.destroy()
    finally:
        sdk.destroy()
