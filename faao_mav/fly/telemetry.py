"""What is seen of a vehicle: what it tells of its flight."""

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

from faao_mav.mission.item import Home
from faao_mav.validate.flown import Fix, FlightRecord
from faao_mav.wire import messages, protocol
from faao_mav.wire.messages import Envelope, Message, WireItem
from faao_mav.wire.protocol import MavCommand, MissionType
from faao_mav.wire.transfer import Peer
from faao_mav.wire.whereabouts import place_in
from faao_mav.wire.wire_items import compare, home_items

Kind: TypeAlias = Literal[
    "finished", "taken over", "held", "left", "refused", "contested", "changed", "rebooted", "lost"
]

PATIENCE = 60.0
"""Seconds after which nothing that has not come is waited for any more: a message, checks that
pass, a setpoint that may be sent. Chosen."""

_SILENT = 5.0  # Seconds without a message, five heartbeats, in which the link counts as broken.
POSITION_RATE = 5.0
"""Positions a second that are asked for. Chosen: at 8 m/s they are 1.6 m apart."""

_SLOW, _MISSED = 1.5, 3.0
"""A message is asked for again after so many seconds without one; positions also when they come
with so many times the period between them. Chosen."""

_FRESH, _READ_AGAIN = 3.0, 1.0
"""Seconds for which what was heard of the vehicle's state counts, three heartbeats, and between two
items that are read again. Chosen."""

_PROPULSION = (0, 1, 2)
"""MAV_BATTERY_FUNCTION of batteries that keep the aircraft in the air: unknown, all, propulsion."""

_WARNING = protocol.MavSeverity.WARNING
_BACK = 2000  # Milliseconds by which a clock goes back at a boot; less is a late packet. Chosen.


@dataclass(frozen=True, slots=True)
class Ending:
    """How watching ended: `kind`, and in words.

    "finished": the mission was flown to its end; "taken over": not by the mission, the pilot or a
    failsafe had the aircraft; "held": we asked it to hold; "left": interrupted by the user;
    "refused": not armed or not started; "contested": another ground station is there, nothing was
    started; "changed": the vehicle's mission is another one now; "rebooted"; "lost": nothing is
    heard any more.
    """

    kind: Kind
    text: str


class Telemetry:
    """What is known of the vehicle of `peer`, which holds the items `rows`, home row included.

    Without `rows` its mission is not looked at. It is asked for `rate` positions a second.

    `told` is what has happened and `said` what the vehicle said since the last order, a warning or
    worse, in words, `fixes` where it was; `heartbeat`, `current`, `status` and `position` are the
    last of these messages, None before the first, `wanted` the last CURRENT_MODE, None where the
    last heartbeat tells another mode. `knows_place`: LOCAL_POSITION_NED was heard, which ArduPilot
    sends once its estimator knows where it is. `place` is where it is by `position`, m above the
    sea, None where it does not tell. `stations` are other ground stations that were heard,
    `strangers` addresses on the network from which something else speaks in its name. `ending` is
    why nothing more can be known, None as long as something can. `begun` is when it began to
    listen, `heard_at` when it last heard the vehicle, after a `silence`, and `disarmed_at` when
    that was armed no more, infinite as long as it is or never was, and once a watch has taken note,
    all in s.
    """

    def __init__(self, peer: Peer, rows: Sequence[WireItem], rate: float = POSITION_RATE) -> None:
        assert peer.vehicle is not None
        self.vehicle = peer.vehicle
        self._peer, self._rows = peer, tuple(rows)
        self._home = home_items(self.vehicle, MissionType.MISSION)
        self.told: list[str] = []
        self.said: list[str] = []
        self.fixes: list[Fix] = []
        self.heartbeat: messages.Heartbeat | None = None
        self.current: messages.MissionCurrent | None = None
        self.status: messages.SysStatus | None = None
        self.position: messages.GlobalPositionInt | None = None
        self.knows_place = False
        self.wanted: messages.CurrentMode | None = None
        self.place: Home | None = None
        self.stations: set[str] = set()
        self.strangers: Set[str] = set()
        self.ending: Ending | None = None
        self._batteries: dict[int, int] = {}
        self.disarmed_at = math.inf
        self._beat_at = self._placed_at = -math.inf
        self._periods = dict.fromkeys((protocol.SYSTEM_STATUS, protocol.CURRENT_ITEM), 1.0)
        self._periods[protocol.POSITION] = 1 / rate
        self._next_item = self._home

    def start(self, now: float) -> None:
        """Begin to listen."""
        self.begun, self.heard_at, self.silence, self._is_silent = now, now, 0.0, False
        self._needed = dict.fromkeys(self._periods, now - _MISSED)
        self._next_reading = now

    def ask_for(self, kind: int, period: float) -> None:
        """Ask for the messages of number `kind` too, `period` s apart, from `start` on."""
        self._periods[kind] = period

    @property
    def items(self) -> int:
        """How many items the mission has, home not counted."""
        return len(self._rows) - self._home

    @property
    def row(self) -> int | None:
        """The row of the mission file that is under way: row 0 is home, also for PX4."""
        return None if self.current is None else self.current.seq + 1 - self._home

    @property
    def armed(self) -> bool:
        """Whether its motors may turn, by its last heartbeat."""
        return self.heartbeat is not None and self.heartbeat.armed

    @property
    def custom_mode(self) -> int:
        """The vehicle's mode by its number; -1 before the first heartbeat."""
        return -1 if self.heartbeat is None else self.heartbeat.custom_mode

    @property
    def mode(self) -> str:
        """The vehicle's mode by its name."""
        return "unknown" if self.heartbeat is None else self.heartbeat.mode_name

    @property
    def height(self) -> float:
        """How high it was last above home as it was then, m."""
        return self.fixes[-1].altitude - self.fixes[-1].home

    def record(self) -> FlightRecord:
        """Return where it was."""
        return FlightRecord.of(self.fixes)

    def where(self, now: float) -> str:
        """Return in words its mode and height, and how old that is."""
        height = f", {self.height:.0f} m above home" if self.fixes else ""
        old = f", {now - self.heard_at:.0f} s ago" if self._is_silent else ""
        return f"in mode {self.mode}{height}{old}"

    @property
    def battery(self) -> int | None:
        """What is left of the emptiest battery that keeps it in the air, percent."""
        told = [*self._batteries.values()]
        told += [] if self.status is None else [self.status.battery_remaining]
        return min((each for each in told if each >= 0), default=None)

    def is_fresh(self, now: float) -> bool:
        """Tell whether mode, armed state and place were heard of in the last seconds."""
        return now - min(self._beat_at, self._placed_at) <= _FRESH

    def hear(self, envelope: Envelope, now: float) -> None:
        """Take note of a message."""
        sender, message = envelope.sender, envelope.message
        match message:
            case messages.Heartbeat(type=protocol.GROUND_STATION_TYPE):
                if str(sender) not in self.stations:
                    self.stations.add(str(sender))
                    self.told.append(f"another ground station is on this link: {sender}")
        if sender != self._peer.address:
            return
        self.silence, self.heard_at = now - self.heard_at, now
        if self._is_silent:
            self._is_silent = False
            self.told.append(f"heard again after {self.silence:.0f} s")
        match message:
            case messages.BatteryStatus(battery_function=function) if function in _PROPULSION:
                self._batteries[message.id] = message.battery_remaining
            case messages.Heartbeat(armed=armed):
                if armed != self.armed:
                    self.disarmed_at = math.inf if armed else now
                self.heartbeat, self._beat_at = message, now
                if self.wanted is not None and self.wanted.custom_mode != message.custom_mode:
                    self.wanted = None
            case messages.CurrentMode():
                self._needed[protocol.CURRENT_MODE], self.wanted = now, message
                if self.heartbeat is not None:
                    self.heartbeat = replace(self.heartbeat, custom_mode=message.custom_mode)
            case messages.GlobalPositionInt():
                self._on_position(message, now)
            case messages.SysStatus():
                self._needed[protocol.SYSTEM_STATUS], self.status = now, message
            case messages.LocalPositionNed():
                self._needed[protocol.LOCAL_POSITION], self.knows_place = now, True
            case messages.MissionCurrent():
                self._needed[protocol.CURRENT_ITEM] = now
                known, self.current = self.current or message, message
                same = (message.total, message.mission_id) == (known.total, known.mission_id)
                if self._rows and not (same and message.total in (0, self.items)):
                    self._end("changed", "the vehicle's mission is another one now than the file's")
            case messages.MissionItemInt(mission_type=MissionType.MISSION, seq=seq, item=item):
                if self._home <= seq < len(self._rows) and item != self._rows[seq]:
                    rows = (*self._rows[:seq], item, *self._rows[seq + 1 :])
                    found = compare(self._rows, rows, MissionType.MISSION, self.vehicle)
                    for wrong in (each for each in found if each.kind == "wrong"):
                        self._end("changed", f"the vehicle's mission is another one now: {wrong}")
            case messages.Statustext(severity=severity, text=text) if severity <= _WARNING:
                self.said.append(text.strip())
                self.told.append(f"the vehicle says: {text.strip()}")

    def tick(self, now: float, patience: float = PATIENCE) -> list[Message]:
        """Take note of the time, and return what to ask the vehicle.

        After `patience` seconds without any message nothing more can be known.
        """
        quiet, out = now - self.heard_at, list[Message]()
        if quiet >= patience:
            self._end("lost", f"nothing was heard for {quiet:.0f} s; the vehicle is on its own")
        elif quiet >= _SILENT and not self._is_silent:
            self._is_silent = True
            self.told.append(f"nothing heard for {quiet:.0f} s")
        for kind, period in self._periods.items():
            if now - self._needed[kind] >= _MISSED:
                self._needed[kind] = now
                ask = (MavCommand.SET_INTERVAL, 0, float(kind), period * 1e6)
                out.append(messages.CommandLong(self._peer.address, *ask))
        # ArduPilot has no number for its mission, and answers each request by itself: its mission
        # is read again item by item, which disturbs nobody.
        reads = self._peer.manners.any_request_order and self._rows
        if reads and now >= self._next_reading:
            self._next_reading, seq = now + _READ_AGAIN, self._next_item
            out.append(messages.MissionRequestInt(self._peer.address, MissionType.MISSION, seq))
            self._next_item = seq + 1 if seq + 1 < len(self._rows) else self._home
        return out

    def _on_position(self, message: messages.GlobalPositionInt, now: float) -> None:
        t = message.time_boot_ms
        last = 1000 * self.fixes[-1].t if self.fixes else -1.0
        if t < last - _BACK:
            self._end("rebooted", "the vehicle has rebooted: what it flies now is not known")
        elif t > last and (place := place_in(message)) is not None:
            self.position, self.place, self._placed_at = message, place, now
            if t < last + 1000 * _SLOW * self._periods[protocol.POSITION]:
                self._needed[protocol.POSITION] = now
            home = (message.alt - message.relative_alt) / 1000
            self.fixes.append(Fix(t / 1000, place.latitude, place.longitude, place.altitude, home))

    def _end(self, kind: Kind, text: str) -> None:
        self.ending = self.ending or Ending(kind, text)
