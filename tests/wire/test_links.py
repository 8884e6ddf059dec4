"""How long transfers take over links of all kinds, and how much they send: on a simulated clock."""

import pytest
from simulate import Station, simulate
from stations import HOME, KINDS, VEHICLE, Counted, peer_of, rows_for

from faao_mav.sim import MockAutopilot, MockKind, behaviour_of
from faao_mav.sim.faults import Faults
from faao_mav.wire.machine import Script
from faao_mav.wire.messages import MissionItemInt, MissionRequestInt
from faao_mav.wire.protocol import GROUND_STATION
from faao_mav.wire.transfer import read_list, send_list

ROWS = 100


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("faults", "telemetry", "seconds", "up", "back"),
    [
        (Faults(), 0.0, 1.0, 1.0, 1.0),
        (Faults(loss=0.05), 0.0, 3.0, 1.3, 1.3),
        (Faults(loss=0.2), 0.0, 8.0, 2.0, 2.0),
        # 20 reports a second take two thirds of what this line can carry.
        (Faults(latency=0.03, rate=2500.0), 20.0, 25.0, 1.3, 1.3),
        (Faults(latency=0.15, reordering=1.0, delay=0.1, seed=1), 0.0, 90.0, 1.2, 1.7),
        # PX4 asks again after 0.25 s, ArduPilot after 1 s, and is answered each time.
        (Faults(latency=0.5), 0.0, 220.0, 2.1, 1.2),
        (Faults(latency=0.1, rate=960.0, loss=0.1, seed=1), 0.0, 80.0, 1.7, 1.4),  # 9600 baud
    ],
    ids=["quick", "5 % lost", "20 % lost", "reports", "disorder", "slow", "narrow"],
)
def test_a_quick_link_is_quick_and_a_slow_one_is_not_flooded(
    kind: MockKind, faults: Faults, telemetry: float, seconds: float, up: float, back: float
) -> None:
    """`up` and `back`: messages of this end to upload and to read, by what there is to say."""
    mock, peer = MockAutopilot(behaviour_of(kind), home=HOME, rate=telemetry), peer_of(kind)
    mock.tick(0.0)
    for talk, most in ((send_list(rows_for(kind, ROWS)[:ROWS], peer), up), (read_list(peer), back)):
        client, server = Counted(Script(talk)), Counted(mock)
        stations = Station(client, GROUND_STATION), Station(server, VEHICLE)
        seconds -= simulate(*stations, faults, until=2000.0)
        assert client.outcome.verdict in ("accepted", "unknown")
        kinds = (MissionItemInt, MissionRequestInt)
        sent = sum(isinstance(each, kinds) for each in client.sent)
        asked = sum(isinstance(each, MissionRequestInt) for each in server.sent)
        assert sent <= most * max(asked, ROWS)
    assert seconds > 0
