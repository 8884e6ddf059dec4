"""Many uploads over links that lose, repeat, delay and disorder: is "verified" ever wrong?

    python benchmarks/sessions.py mocks [--sessions 10000] [--jobs 2]
    FAAO_AUTOPILOTS=... python benchmarks/sessions.py arducopter [--sessions 100]

Each session has its own seed: what is sent (mission, fence or rally points), how the link treats
it, and what the vehicle held before. Mocks run on a simulated clock, and what they hold is looked
at in their own storage. Real autopilots (`arducopter`, `arduplane`, `px4`) are read by MAVSDK after
every session that was verified, over a link without faults. One line for each kind of session:
verified, reported as not verified, verified though the vehicle holds something else ("wrong"), and
without an end after `LONGEST`.
"""

import argparse
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from unittest.mock import patch

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "wire"))

from joblib import Parallel, delayed
from mavsdk.plugins.mission_raw import MissionRaw
from simulate import Station, simulate
from simulators import KINDS, simulated, usable
from stations import HOME, a_mission, mock_of, peer_of
from uploads import a_mavsdk

from faao_mav.autopilot import VehicleType
from faao_mav.errors import LinkError
from faao_mav.mission import Mission
from faao_mav.mission.fence import Circle, Fence, Polygon, RallyPoint
from faao_mav.sim.faults import Faults, FaultyTransport
from faao_mav.wire import link, upload
from faao_mav.wire.jobs import upload_parts
from faao_mav.wire.machine import Script
from faao_mav.wire.messages import WireItem
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.transport import open_transport
from faao_mav.wire.wire_items import wire_items

LONGEST = 1200.0
"""Seconds after which a session counts as one without an end."""


def session(seed: int) -> tuple[Mission, Faults]:
    """Return what `seed` draws: a mission, and a link: loss to 30 %, the rest now and then."""
    random = Random(seed)

    def now_and_then(value: float) -> float:
        return value if random.random() < 0.5 else 0.0

    begin = random.uniform(0.0, 5.0)
    outage = (begin, begin + random.uniform(0.5, 8.0))
    faults = Faults(
        loss=random.choice((0.0, 0.05, 0.1, 0.2, 0.3)),
        duplication=now_and_then(0.05),
        corruption=now_and_then(0.01),
        reordering=now_and_then(0.1),
        delay=0.3,
        latency=random.choice((0.001, 0.02, 0.15)),
        outages=(outage,) if random.random() < 0.2 else (),
        seed=seed,
    )
    shift = random.uniform(-0.01, 0.01)
    corners = tuple(
        (HOME.latitude + shift + 0.01 * north, HOME.longitude + 0.01 * east)
        for north, east in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    )
    circles = tuple(
        Circle((HOME.latitude + 0.001 * k, HOME.longitude), 20.0 + k, inclusion=False)
        for k in range(1, random.randint(1, 5))
    )
    fence = Fence((Polygon(corners, inclusion=True),), circles)
    rally = tuple(
        RallyPoint(HOME.latitude + shift, HOME.longitude + 1e-3 * k, 30.0 + k)
        for k in range(random.randint(1, 5))
    )
    beside = {"fence": fence, "rally": rally} if random.random() < 0.5 else {}
    return a_mission(random.randint(3, 40), shift, **beside), faults


def parts(mission: Mission, vehicle: VehicleType | None) -> dict[MissionType, tuple[WireItem, ...]]:
    """Return the lists of `mission` that are not empty, as `vehicle` is sent them."""
    lists = {part: wire_items(mission, part, vehicle) for part in MissionType}
    return {part: rows for part, rows in lists.items() if rows}


Row = tuple[int, int, int, float, float]


def meaning(part: MissionType, row: WireItem) -> Row:
    """Return what every autopilot keeps of a row: command, place, height, size of a fence area."""
    height = round(row.z, 2) if part is not MissionType.FENCE else 0.0
    size = round(row.params[0], 3) if part is MissionType.FENCE else 0.0
    return row.command, row.x, row.y, height, size


def equal(part: MissionType, sent: tuple[WireItem, ...], found: tuple[WireItem, ...]) -> bool:
    """Tell whether `found` is `sent`; the home item (in frame 0) is the vehicle's own."""
    home = part is MissionType.MISSION and sent[0].command == 16 and sent[0].frame == 0
    pairs = [[meaning(part, row) for row in rows[home:]] for rows in (sent, found)]
    return pairs[0] == pairs[1]


def on_mock(seed: int) -> str:
    """Return how the session with this seed went on a mock."""
    mission, faults = session(seed)
    kind = ("px4", "ardupilot")[seed % 2]
    mock = mock_of(kind)
    peer = peer_of(mock.behaviour.family.key)
    lists = parts(mission, peer.vehicle)
    script = Script(upload_parts(list(lists.items()), peer))
    simulate(Station(script, peer.own), Station(mock, peer.address), faults, LONGEST)
    if script.outcome is None:
        return f"{kind}: without an end"
    verified = [report.part for report in script.outcome if report.verified]
    if not all(equal(part, lists[part], mock.lists.items(part)) for part in verified):
        return f"{kind}: wrong"
    failed = [report for report in script.outcome if not report.verified]
    return f"{kind}: not verified ({failed[0].verdict})" if failed else f"{kind}: verified"


def on_real(kind: str, seeds: range) -> Iterator[str]:
    """Yield how each session went on the real autopilot `kind`."""
    with (
        tempfile.TemporaryDirectory() as where,
        simulated(
            usable(Path(os.environ["FAAO_AUTOPILOTS"]), Path(where)), kind, Path(where)
        ) as connection,
    ):
        port = int(connection.rpartition(":")[2])
        for seed in seeds:
            mission, faults = session(seed)
            begun = time.monotonic()
            try:
                with patch.object(link, "open_transport", over(faults)):
                    report = upload(mission, connection, wait=30)
            except LinkError as error:
                yield f"{kind}: no session ({error})"
                continue
            if time.monotonic() - begun > LONGEST:
                yield f"{kind}: without an end"
            elif not report.verified:
                yield f"{kind}: not verified ({report.problems[0]})"
            else:
                right = read_by_mavsdk(port, parts(mission, report.vehicle.vehicle))
                yield f"{kind}: verified" if right else f"{kind}: wrong"


def over(faults: Faults) -> Callable[[str], FaultyTransport]:
    """Return what opens a link with these `faults`."""
    return lambda text: FaultyTransport(open_transport(text), faults)


def read_by_mavsdk(port: int, lists: dict[MissionType, tuple[WireItem, ...]]) -> bool:
    """Tell whether MAVSDK reads these lists from the vehicle that sends to `port`."""
    with a_mavsdk(port) as sdk:
        system = sdk.first_autopilot(30.0)
        assert system is not None
        client = MissionRaw(system)
        download = {
            MissionType.MISSION: client.download_mission,
            MissionType.FENCE: client.download_geofence,
            MissionType.RALLY: client.download_rallypoints,
        }
        for part, rows in lists.items():
            found = tuple(
                WireItem(i.command, i.frame, (i.param1, i.param2, 0.0, 0.0), i.x, i.y, i.z)
                for i in download[part]()
            )
            if not equal(part, rows, found):
                return False
    return True


def main() -> None:
    """Print how many sessions went how."""
    parser = argparse.ArgumentParser()
    parser.add_argument("where", choices=("mocks", *KINDS))
    parser.add_argument("--sessions", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    seeds = range(options.sessions)
    if options.where == "mocks":
        went = Parallel(options.jobs)(delayed(on_mock)(seed) for seed in seeds)
    else:
        went = list(on_real(options.where, seeds))
    for how, number in sorted(Counter(went).items()):
        print(f"{number:6} {how}")


if __name__ == "__main__":
    main()
