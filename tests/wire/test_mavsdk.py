"""MAVSDK, written by others: its client and our mock, our client and its server, our plans."""

import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from conftest import free_port
from mavsdk.component_type import ComponentType
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.mission_raw import MissionItem as SdkItem
from mavsdk.plugins.mission_raw import MissionRaw
from mavsdk.plugins.mission_raw_server import MissionRawServer
from served import running
from stations import FENCE, HOME, RALLY, a_mission, places

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.files import plan_target
from faao_mav.mission import Mission, MissionItem
from faao_mav.mission.formats import write_qgc_plan
from faao_mav.mission.formats.qgc_plan import read_qgc_plan
from faao_mav.mission.item import fence_items, rally_items
from faao_mav.sim import MockAutopilot, MockKind, behaviour_of
from faao_mav.wire import upload
from faao_mav.wire.messages import WireItem
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.wire_items import wire_items

DATA = Path(__file__).parent.parent / "data" / "missions"


@contextmanager
def mavsdk(component: ComponentType, connection: str) -> Iterator[Mavsdk]:
    sdk = Mavsdk(Configuration.create_with_component_type(component))
    try:
        sdk.add_any_connection(connection)
        yield sdk
    finally:
        sdk.destroy()


def sdk_items(rows: tuple[WireItem, ...], part: MissionType) -> list[SdkItem]:
    return [
        SdkItem(seq, r.frame, r.command, int(seq == 0), 1, *r.params, r.x, r.y, r.z, int(part))
        for seq, r in enumerate(rows)
    ]


def assert_read_alike(client: MissionRaw, text: str, kind: str) -> None:
    """MAVSDK makes of a plan's `text` what we do."""
    read = client.import_qgroundcontrol_mission_from_string(text)
    mission = read_qgc_plan(text).mission
    flown = read.mission_items[kind == "ardupilot" :]  # it puts the planned home before them
    assert [row.autocontinue for row in flown] == [item.autocontinue for item in mission.items]
    fence = replace(mission.fence, breach_return=None)  # which it passes over
    for rows, items in (
        (flown, mission.items),
        (read.geofence_items, fence_items(fence)),
        (read.rally_items, rally_items(mission.rally)),
    ):
        for row, item in zip(rows, items, strict=True):
            scale = 1 if item.frame == 2 else 1e7
            numbers = row.param1, row.param2, row.param3, row.param4, row.z
            assert (row.command, row.frame) == (item.command, item.frame)
            assert numbers == pytest.approx((*item.params, item.z), nan_ok=True)
            assert max(abs(row.x - item.x * scale), abs(row.y - item.y * scale)) <= 1


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_mavsdk_reads_plans_uploads_downloads_clears_and_flies(kind: MockKind) -> None:
    port, reached = free_port(), threading.Event()
    mock = MockAutopilot(behaviour_of(kind), home=HOME, beat=0.1, speedup=40.0)
    mission = a_mission(8, fence=FENCE, rally=RALLY)
    rows, fence, rally = (wire_items(mission, part, mock.vehicle) for part in MissionType)
    with (
        mavsdk(ComponentType.GROUND_STATION, f"udpin://127.0.0.1:{port}") as sdk,
        running(mock, f"udpout:127.0.0.1:{port}"),
    ):
        system = sdk.first_autopilot(10.0)
        assert system is not None, "MAVSDK saw no heartbeat in 10 s"
        client = MissionRaw(system)
        pause = MissionItem(16, 3, (2.5, 0.0, 0.0, math.nan), 47.0, 8.0, 30.0, autocontinue=False)
        jump = MissionItem(177, 2, (3.0, 2.0, 0.0, 0.0))
        odd = Mission((*mission.items, pause, jump), HOME, FENCE, RALLY)
        assert_read_alike(client, write_qgc_plan(odd, plan_target(Vehicle(kind))), kind)
        for name in ("px4.plan", "survey.plan", "fence_and_rally.plan"):
            assert_read_alike(client, (DATA / name).read_text(), kind)
        client.upload_mission(sdk_items(rows, MissionType.MISSION))
        client.upload_geofence(sdk_items(fence, MissionType.FENCE))
        client.upload_rally_points(sdk_items(rally, MissionType.RALLY))
        assert places(mock.lists.items(MissionType.MISSION)) == places(rows)
        assert (mock.mission().fence, mock.mission().rally) == (FENCE, RALLY)
        for read, sent in (
            (client.download_mission, rows),
            (client.download_geofence, fence),
            (client.download_rallypoints, rally),
        ):
            assert places(read()) == places(sent)
        client.clear_mission()
        assert mock.mission().items == ()
        client.upload_mission(sdk_items(rows, MissionType.MISSION))

        def progress(now: Any, _: object) -> None:
            if now.current == len(rows) - 1:
                reached.set()

        handle = client.subscribe_mission_progress(progress)
        Action(system).arm()
        assert mock.armed
        client.start_mission()
        assert reached.wait(30)
        client.unsubscribe_mission_progress(handle)
        for _ in range(200):
            if mock.armed:
                time.sleep(0.1)
        assert not mock.armed, "it has not landed"


def test_our_client_uploads_to_mavsdks_server() -> None:
    port, arrived = free_port(), threading.Event()
    received: list[list[SdkItem]] = []

    def incoming(result: object, plan: Any, _: object) -> None:
        received.append(plan.mission_items)
        arrived.set()

    with mavsdk(ComponentType.AUTOPILOT, f"udpout://127.0.0.1:{port}") as sdk:
        server = MissionRawServer(sdk.server_component())
        server.subscribe_incoming_mission(incoming)
        report = upload(a_mission(8), f"udpin:127.0.0.1:{port}", system=1)
        assert arrived.wait(5)
        server.destroy()
    assert report.verified
    assert report.vehicle.autopilot == "generic"
    rows = wire_items(a_mission(8), MissionType.MISSION, report.vehicle.vehicle)
    assert places(received[0]) == places(rows)
