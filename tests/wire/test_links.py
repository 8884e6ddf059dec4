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

BOTH = pytest.mark.parametrize("kind", KINDS)


def there_and_back(
    kind: MockKind, count: int, faults: Faults, telemetry: float = 0.0
) -> list[tuple[float, int, int]]:
    """Return how an upload of `count` rows and reading them back went.

    Seconds, and the items and requests that this end and the vehicle sent.
    """
    mock, peer, courses = (
        MockAutopilot(behaviour_of(kind), home=HOME, rate=telemetry),
        peer_of(kind),
        [],
    )
    mock.tick(0.0)
    for talk in (send_list(rows_for(kind, count)[:count], peer), read_list(peer)):
        client, server = Counted(Script(talk)), Counted(mock)
        stations = Station(client, GROUND_STATION), Station(server, VEHICLE)
        took = simulate(*stations, faults, until=2000.0)
        assert client.outcome.verdict in ("accepted", "unknown")
        kinds = (MissionItemInt, MissionRequestInt)
        ours, theirs = (sum(isinstance(m, kinds) for m in end.sent) for end in (client, server))
        courses.append((took, ours, theirs))
    return courses


@BOTH
def test_a_quick_link_is_quick_and_sends_little_more_than_is_needed(kind: MockKind) -> None:
    for loss, seconds, messages in ((0.0, 3, 1), (0.05, 6, 1.3), (0.2, 30, 2)):
        courses = there_and_back(kind, 300, Faults(loss=loss, seed=0))
        assert sum(took for took, *_ in courses) < seconds
        assert max(max(ours, theirs) for _, ours, theirs in courses) <= messages * 300
    # 20 reports a second take two thirds of what this line can carry.
    for took, ours, _ in there_and_back(kind, 100, Faults(latency=0.03, rate=2500.0), 20.0):
        assert ours <= 1.3 * 100
        assert took < 15


@BOTH
def test_a_slow_link_is_not_flooded(kind: MockKind) -> None:
    for faults in (
        Faults(latency=0.1),
        Faults(latency=0.15, reordering=1.0, delay=0.1, seed=1),
        Faults(latency=0.5),
        Faults(latency=0.03, rate=5760.0),  # 57600 baud
        Faults(latency=0.1, rate=960.0),  # 9600 baud
    ):
        (_, up, asked), (_, back, _) = there_and_back(kind, 100, faults)
        # A late request ends a download of PX4, which begins anew.
        late = kind == "px4" and faults.delay > 0
        assert back <= (1.7 if late else 1.2) * 100, faults
        # PX4 asks again after 0.25 s, ArduPilot after 1 s, and is answered each time.
        assert up <= (2.1 if faults.latency >= 0.5 else 1.2) * asked, faults
        lossy = Faults(loss=0.1, latency=faults.latency, rate=faults.rate, seed=1)
        (_, up, asked), (_, back, _) = there_and_back(kind, 100, lossy)
        assert back <= 1.4 * 100, faults
        assert up <= 1.7 * max(asked, 100), faults
