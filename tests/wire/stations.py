"""Missions, peers and short ways to run machines for the tests of the wire."""

import hashlib
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import pytest
from simulate import Station, simulate

from faao_mav.autopilot import VehicleType, vehicle_type
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.fence import Circle, Fence, Polygon, RallyPoint
from faao_mav.sim import Behaviour, MockAutopilot, MockKind, behaviour_of
from faao_mav.sim.faults import Faults
from faao_mav.wire.jobs import upload_parts
from faao_mav.wire.machine import Script
from faao_mav.wire.messages import Envelope, Message, WireItem
from faao_mav.wire.protocol import GROUND_STATION, Address, MissionType
from faao_mav.wire.transfer import Peer
from faao_mav.wire.wire_items import wire_items

VEHICLE = Address(1, 1)
FOREIGN = Address(250, 190)
KINDS: tuple[MockKind, ...] = ("ardupilot", "px4")
HOME = Home(-35.363262, 149.165237, 584.0)
FENCE = Fence(
    (Polygon(((-35.3, 149.1), (-35.4, 149.1), (-35.4, 149.2)), inclusion=True),),
    (Circle((-35.36, 149.16), 40.0, inclusion=False),),
)
RALLY = (RallyPoint(-35.36, 149.16, 30.0), RallyPoint(-35.37, 149.17, 40.0))


def vehicle_of(kind: str) -> VehicleType | None:
    """Return the copter of a kind of mock autopilot; None for "generic"."""
    return None if kind == "generic" else vehicle_type(kind, "copter")


def peer_of(kind: str) -> Peer:
    return Peer(GROUND_STATION, VEHICLE, vehicle_of(kind))


def hurry(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have transfers given up soon; on a busy machine a mock may need a second to answer."""
    for module in ("machine", "transfer"):
        monkeypatch.setattr(f"faao_mav.wire.{module}.SILENCE", 2.0)
    for module in ("transfer", "jobs"):
        monkeypatch.setattr(f"faao_mav.wire.{module}.ATTEMPTS", 1)


def signing_key(phrase: str) -> bytes:
    """Return the key that ground stations make of a pass phrase."""
    return hashlib.sha256(phrase.encode()).digest()


def a_mission(count: int, shift: float = 0.0, **more: Any) -> Mission:
    """Return a mission of take-off, waypoints and a return, `shift` degrees away."""
    start = MissionItem(22, 3, x=HOME.latitude, y=HOME.longitude, z=20.0)
    way = [
        MissionItem(16, 3, (float(k % 7), 0.0, 0.0, 0.0), -35.36 + shift + k * 1e-5, 149.16, 30.0)
        for k in range(count - 2)
    ]
    return Mission((start, *way, MissionItem(20, 2)), HOME, **more)


def rows_for(kind: str, count: int = 5, shift: float = 0.0) -> tuple[WireItem, ...]:
    """Return the rows of a mission of `count` items."""
    return wire_items(a_mission(count, shift), MissionType.MISSION, vehicle_of(kind))


def places(rows: Iterable[Any]) -> list[tuple[int, int, int, float]]:
    """Return what tells rows apart and no autopilot changes."""
    return [(row.command, row.x, row.y, row.z) for row in rows]


class Desk:
    """A machine on a table: told things by hand, one at a time."""

    def __init__(self, machine: Any, sender: Address = VEHICLE) -> None:
        self.machine, self.sender = machine, sender
        self.now = 0.0
        self.sent: list[Message] = []

    def start(self) -> list[Any]:
        return self._note(self.machine.start(self.now))

    def tell(self, message: Message, sender: Address | None = None) -> list[Any]:
        """Return the answer to `message`."""
        envelope = Envelope(sender or self.sender, message)
        return self._note(self.machine.on(envelope, self.now))

    def wait(self, seconds: float) -> list[Any]:
        """Return what is sent within `seconds` of silence; an outcome ends them."""
        end, out = self.now + seconds, list[Any]()
        while self.machine.outcome is None and self.machine.deadline <= end:
            self.now = max(self.now, self.machine.deadline)
            out += self._note(self.machine.tick(self.now))
        self.now = end if self.machine.outcome is None else self.now
        return out

    def _note(self, messages: Sequence[Message]) -> list[Any]:
        self.sent += messages
        return list(messages)


def upload_to(
    mock: MockAutopilot,
    rows: Sequence[WireItem],
    faults: Faults | None = None,
    *,
    part: MissionType = MissionType.MISSION,
    until: float = 600.0,
    **more: Any,
) -> tuple[Any, float]:
    """Upload `rows` to `mock` over a simulated link, verified; report and time taken."""
    peer = peer_of(mock.behaviour.family.key)
    script = Script(upload_parts([(part, tuple(rows))], peer))
    client = Station(script, GROUND_STATION)
    took = simulate(client, Station(mock, VEHICLE), faults, until, **more)
    return (script.outcome[0] if script.outcome else None), took


def mock_of(kind: str | Behaviour, **options: Any) -> MockAutopilot:
    """Return a mock autopilot that sends no position reports."""
    behaviour = kind if isinstance(kind, Behaviour) else behaviour_of(cast(MockKind, kind))
    return MockAutopilot(behaviour, home=HOME, rate=0.0, **options)


@dataclass
class Air:
    """A transport without sockets: `says` returns what is heard, and from where, of what is sent.

    Before something is sent, and where nothing is said for a while, that is of None.
    """

    says: Callable[[bytes | None], list[tuple[bytes, str]]]
    listens: bool = True
    sent: list[tuple[bytes, str | None]] = field(default_factory=list)
    waiting: list[tuple[bytes, str]] = field(default_factory=list)

    def read(self, timeout: float) -> list[tuple[bytes, str]]:
        self.waiting = self.waiting or self.says(None)
        if not self.waiting:
            time.sleep(min(max(timeout, 0.0), 0.02))
        arrived, self.waiting = self.waiting, []
        return arrived

    def write(self, data: bytes, to: str | None = None) -> None:
        self.sent.append((data, to))
        self.waiting += self.says(data)

    def close(self) -> None:
        pass
