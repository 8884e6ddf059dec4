"""Watching a mission from the ground to its end, and starting it where that is asked for."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypeAlias

from faao_mav.mavlink.machine import Machine, Progress
from faao_mav.mavlink.messages import (
    CommandAck,
    CommandLong,
    Envelope,
    GlobalPositionInt,
    Heartbeat,
    Message,
    MissionCurrent,
    MissionItemInt,
    MissionRequestInt,
    SetMode,
    Statustext,
    SysStatus,
    WireItem,
)
from faao_mav.mavlink.modes import mode_name, modes_of
from faao_mav.mavlink.protocol import (
    CURRENT_ITEM,
    GROUND_STATION_TYPE,
    MISSION_COMPLETE,
    POSITION,
    SYSTEM_STATUS,
    MavCommand,
    MavSeverity,
    MissionType,
)
from faao_mav.mavlink.transfer.exchange import Peer
from faao_mav.mavlink.transfer.verify import compare
from faao_mav.mavlink.wire_items import home_items

if TYPE_CHECKING:
    from faao_mav.mavlink.flying.record import FlightRecord

Kind: TypeAlias = Literal[
    "finished", "taken over", "held", "left", "refused", "contested", "changed", "rebooted", "lost"
]
Phase: TypeAlias = Literal[
    "checking", "arming", "starting", "waiting", "flying", "holding", "ending", "aside"
]

_ACCEPTED, _IN_PROGRESS = 0, 5
"""MAV_RESULT."""

_TICK = 0.5
"""Seconds between two looks at what is due; chosen."""

_LISTEN = 2.0
"""Seconds of listening for other ground stations before anything is started: two of their
heartbeats."""

_AGAIN, _TRIES = 1.5, 5
"""Seconds after which a command without an answer is repeated, and how often it is sent: as the
MAVLink guide has it for missions."""

_SILENT = 5.0
"""Seconds without any message after which the link counts as interrupted: five heartbeats."""

_RATES = {POSITION: 0.2, SYSTEM_STATUS: 1.0, CURRENT_ITEM: 1.0}
"""Messages that watching needs, and the seconds between two of them that are asked for. Chosen: at
8 m/s positions are 1.6 m apart."""

_MISSED = 3.0
"""Seconds without one of these after which it is asked for again."""

_BACK = 2000
"""Milliseconds by which a vehicle's clock goes back when it has rebooted; less is a late packet."""

_REBOOT = 1.5
"""Seconds in which a vehicle that is not armed any more can show that it has rebooted; chosen."""

_FIRST_DO = 176
"""From this command on an item is no place to fly to or to wait at."""


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


@dataclass(slots=True)
class Samples:
    """Where the vehicle was: its clock in s, degrees, metres above home, item under way."""

    t: list[float] = field(default_factory=list)
    latitude: list[float] = field(default_factory=list)
    longitude: list[float] = field(default_factory=list)
    height: list[float] = field(default_factory=list)

    def record(self) -> "FlightRecord":
        """Return them as arrays."""
        import numpy as np

        from faao_mav.mavlink.flying.record import FlightRecord

        place = np.array(self.latitude), np.array(self.longitude)
        return FlightRecord(np.array(self.t), *place, np.array(self.height))


class Watch(Machine[Ending]):
    """A machine that watches the vehicle of `peer` fly the mission `rows` to its end.

    `rows` are the items that it holds, the home row included where it has one. With `arm` it arms
    and starts the mission once the autopilot's own checks pass and no other ground station was
    heard; else somebody else does. `lands`: the flight ends on the ground. After `patience` seconds
    without a message, or of checks that do not pass, it ends.

    Nothing is sent but what asks for telemetry, until `arm` or `cancel` has a reason; and nothing
    ever again once the mode is one that was not asked for: then the pilot, or a failsafe, has the
    aircraft. `cancel` asks a flight that was started here to hold; a second time, and in any other
    flight, it leaves. `told` is what has happened, in words.

    Raises `ValueError` for a vehicle that is not known.
    """

    def __init__(
        self,
        peer: Peer,
        rows: Sequence[WireItem],
        *,
        arm: bool = False,
        lands: bool = True,
        patience: float = 60.0,
    ) -> None:
        super().__init__()
        if peer.vehicle is None:
            raise ValueError("watch: a vehicle that is known is needed")
        self._peer, self._vehicle, self._rows = peer, peer.vehicle, tuple(rows)
        self._modes, self._home = modes_of(peer.vehicle), home_items(peer.vehicle, _MISSION)
        places = [n for n, row in enumerate(rows) if row.command < _FIRST_DO]
        self._last = max(places, default=len(rows) - 1)
        self._arm, self._lands, self._patience = arm, lands, patience
        self.phase: Phase = "checking" if arm else "waiting"
        self.told: list[str] = []
        self.samples = Samples()
        self.heartbeat: Heartbeat | None = None
        self.current: MissionCurrent | None = None
        self.status: SysStatus | None = None
        self._armed = self._silent = False
        self._disarmed_at: float | None = None
        self._furthest = 0
        self._stations: set[str] = set()
        self._said: list[str] = []
        self._begun = self._heard = 0.0
        self._heard_of = dict.fromkeys(_RATES, float("-inf"))
        self._asked: dict[int, float] = {}
        self._mode_before = -1
        self._command: Callable[[], Message] | None = None
        self._sent, self._next_try = 0, 0.0
        self._checked, self._next_check = self._home, 0.0

    @property
    def mode(self) -> str:
        """The vehicle's mode by its name."""
        return "unknown" if self.heartbeat is None else mode_name(self.heartbeat)

    @property
    def row(self) -> int | None:
        """The row of the mission file that is under way: row 0 is home, also for PX4."""
        return None if self.current is None else self._row(self.current.seq)

    def _row(self, seq: int) -> int:
        return seq + 1 - self._home

    @property
    def progress(self) -> Progress:
        """What is going on, at which item of how many."""
        return f"watching ({self.phase})", self.row or 0, self._row(len(self._rows)) - 1

    def start(self, now: float) -> Sequence[Message]:
        """Listen, and ask for telemetry."""
        self._begun = self._heard = now
        return self._time_out(now)

    def cancel(self, now: float) -> Sequence[Message]:
        """Ask the flight to hold, or leave it: what has been asked for is told."""
        if self._arm and self.phase in ("starting", "flying"):
            self.phase = "holding"
            self.told.append("asking the vehicle to hold; interrupt again to leave it")
            return self._say(self._hold, now)
        if self.phase == "arming":
            self._end("left", "interrupted before the start; the vehicle is asked to disarm")
            return [self._arming(False)]
        self._end("left", f"no longer watched; the vehicle is in mode {self.mode}")
        return ()

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        sender, message = envelope.sender, envelope.message
        if isinstance(message, Heartbeat) and message.type == GROUND_STATION_TYPE:
            self._on_station(f"system {sender.system}, component {sender.component}")
        if sender != self._peer.address:
            return ()
        if self._silent:
            self.told.append(f"heard again after {now - self._heard:.0f} s")
        self._heard, self._silent = now, False
        match message:
            case Heartbeat():
                self._on_heartbeat(message, now)
            case GlobalPositionInt():
                self._heard_of[POSITION] = now
                self._on_position(message)
            case SysStatus():
                self._heard_of[SYSTEM_STATUS], self.status = now, message
            case MissionCurrent():
                self._heard_of[CURRENT_ITEM] = now
                self._on_current(message)
            case MissionItemInt(mission_type=MissionType.MISSION, seq=seq, item=item):
                self._on_item(seq, item)
            case Statustext(severity=severity, text=text) if severity <= MavSeverity.WARNING:
                self._said.append(text.strip())
                self.told.append(f"the vehicle says: {text.strip()}")
            case CommandAck(target, command, result) if self._peer.own.takes(target):
                return self._on_ack(command, result, now)
        return ()

    def _time_out(self, now: float) -> Sequence[Message]:
        self._due = now + _TICK
        quiet = now - self._heard
        if quiet >= self._patience:
            self._end("lost", f"nothing was heard for {quiet:.0f} s; the vehicle is on its own")
        elif quiet >= _SILENT and not self._silent:
            self._silent = True
            self.told.append(f"nothing heard for {quiet:.0f} s")
        if self._disarmed_at is not None and now >= self._disarmed_at + _REBOOT:
            self._disarmed_at = None
            return self._disarmed()
        if self.outcome is not None:
            return ()
        out = [*self._ask_for_telemetry(now), *self._ask_for_an_item(now)]
        if self.phase == "checking":
            return [*out, *self._check(now)]
        return [*out, *self._repeat(now)]

    # ---- what is heard

    def _on_station(self, name: str) -> None:
        if name not in self._stations:
            self._stations.add(name)
            self.told.append(f"another ground station is on this link: {name}")

    def _on_position(self, message: GlobalPositionInt) -> None:
        t, samples = message.time_boot_ms, self.samples
        last = 1000 * samples.t[-1] if samples.t else -1.0
        if t < last - _BACK:
            self._end("rebooted", "the vehicle has rebooted: what it flies now is not known")
        elif t > last:
            samples.t.append(t / 1000)
            samples.latitude.append(message.lat / 1e7)
            samples.longitude.append(message.lon / 1e7)
            samples.height.append(message.relative_alt / 1000)

    def _on_current(self, message: MissionCurrent) -> None:
        before, self.current = self.current, message
        if self.phase in ("flying", "holding", "ending"):
            self._furthest = max(self._furthest, message.seq)
        own = len(self._rows) - self._home
        known = before or message
        same = (message.total, message.mission_id) == (known.total, known.mission_id)
        if not same or message.total not in (0, own):
            self._end("changed", "the vehicle's mission is another one now than the file's")
        elif message.mission_state == MISSION_COMPLETE and self.phase == "flying":
            self._over()

    def _on_item(self, seq: int, item: WireItem) -> None:
        if not self._home <= seq < len(self._rows):
            return
        rows = (*self._rows[: self._home], self._rows[seq])
        found = compare(rows, (*rows[:-1], item), _MISSION, self._vehicle)
        wrong = next((each for each in found if each.kind == "wrong"), None)
        if wrong is not None:
            text = f"{wrong.field} is {wrong.found}, in the file {wrong.sent}"
            row = f"item {self._row(seq)} of the vehicle's mission"
            self._end("changed", f"{row} is another one now: {text}")

    def _on_heartbeat(self, message: Heartbeat, now: float) -> None:
        was_armed, self.heartbeat = self._armed, message
        self._armed = message.armed
        mode, mission, hold = message.custom_mode, self._modes.mission, self._modes.hold
        if was_armed != self._armed:
            self._disarmed_at = None if self._armed else now
        match self.phase:
            case "arming" if mode != self._mode_before:
                self._step_aside()
            case "starting" if mode not in (self._mode_before, mission):
                self._step_aside()
            case "starting" | "waiting" if self._armed and mode == mission:
                self.phase, self._command = "flying", None
                self.told.append("the mission is under way")
            case "flying" if mode != mission and self._furthest >= self._last:
                self._over()
            case "flying" if mode != mission:
                self._step_aside()
            case "holding" if mode == hold and self._command is not None:
                self._command = None
                self.told.append("it holds; interrupt again to leave it")
            case "holding" if mode not in (mission, hold) or (
                mode == mission and self._command is None
            ):
                self._step_aside()

    def _on_ack(self, command: int, result: int, now: float) -> Sequence[Message]:
        awaited = {"arming": MavCommand.ARM, "starting": MavCommand.START}.get(self.phase)
        if command != awaited or result == _IN_PROGRESS:
            return ()
        if result != _ACCEPTED:
            return self._refused(f"answers {MavCommand(command).name} with MAV_RESULT {result}")
        if self.phase == "arming":
            self.phase = "starting"
            return self._say(self._starting, now)
        return ()

    def _disarmed(self) -> Sequence[Message]:
        match self.phase:
            case "flying" | "ending" if self._furthest >= self._last:
                self._end("finished", "landed and disarmed at the end of the mission")
            case "flying":
                text = f"disarmed at item {self.row}, before the end of the mission"
                self._end("taken over", text)
            case "holding":
                self._end("held", "disarmed after it was asked to hold")
            case "ending":
                self._end("finished", "disarmed after the end of the mission")
            case "aside":
                self._end("taken over", "disarmed; it was not the mission that flew it last")
            case "arming" | "starting":
                return self._refused("disarmed before the mission began")
        return ()

    def _over(self) -> None:
        """The mission is done; what is left is the landing, if there is one."""
        self.phase = "ending"
        if not self._lands:
            self._end("finished", f"the mission is over; the vehicle is in mode {self.mode}")

    def _step_aside(self) -> None:
        self.phase, self._command = "aside", None
        self.told.append(
            f"mode {self.mode}: the pilot or a failsafe has the aircraft; nothing more is sent"
        )

    # ---- what is sent

    def _check(self, now: float) -> Sequence[Message]:
        """Arm, if there is nothing against it."""
        waited, beat, current = now - self._begun, self.heartbeat, self.current
        if beat is not None and beat.armed:
            self._end("refused", "it is armed already: watch it without --arm")
        elif self._stations:
            names = "; ".join(sorted(self._stations))
            self._end("contested", f"nothing was started: another ground station ({names})")
        elif current is not None and current.seq > self._home:
            text = f"it would go on at item {self.row}, not at the beginning"
            self._end("refused", f"nothing was started: {text}; set the first item (or reboot)")
        elif waited >= self._patience:
            said = "; ".join(dict.fromkeys(self._said)) or "it does not say why"
            self._end("refused", f"its own checks do not pass in {waited:.0f} s: {said}")
        if self.outcome is not None or waited < _LISTEN or beat is None or current is None:
            return ()
        if self.status is None or not self.status.may_arm:
            return ()
        self.phase, self._mode_before = "arming", beat.custom_mode
        own = len(self._rows) - self._home
        self.told.append(f"its own checks pass: arming, and starting {own} items")
        return self._say(lambda: self._arming(True), now)

    def _arming(self, wanted: bool) -> Message:
        return CommandLong(
            self._peer.address, MavCommand.ARM, max(0, self._sent - 1), float(wanted)
        )

    def _starting(self) -> Message:
        return CommandLong(self._peer.address, MavCommand.START, max(0, self._sent - 1))

    def _hold(self) -> Message:
        return SetMode(self._peer.address.system, 1, self._modes.hold)

    def _say(self, command: Callable[[], Message], now: float) -> Sequence[Message]:
        """Send `command`, and repeat it until it is answered."""
        self._command, self._sent, self._next_try = command, 0, now
        return self._repeat(now)

    def _repeat(self, now: float) -> Sequence[Message]:
        if self._command is None or now < self._next_try:
            return ()
        if self._sent == _TRIES:
            if self.phase == "holding":
                self._command = None
                self.told.append("it does not confirm that it holds")
                return ()
            return self._refused("does not answer")
        self._sent, self._next_try = self._sent + 1, now + _AGAIN
        return [self._command()]

    def _refused(self, why: str) -> Sequence[Message]:
        """End before the start; an aircraft that was armed here is asked to disarm again."""
        said = f": {'; '.join(dict.fromkeys(self._said))}" if self._said else ""
        armed = self.phase == "starting"
        self._end("refused", f"the vehicle {why}{said}" + (", and disarms" if armed else ""))
        self._sent = 0
        return [self._arming(False)] if armed else ()

    def _ask_for_telemetry(self, now: float) -> Sequence[Message]:
        """Ask for the messages that do not come, or not yet as often as they are needed."""
        out = []
        for kind, period in _RATES.items():
            missed = now - max(self._heard_of[kind], self._asked.get(kind, self._begun - _MISSED))
            if missed >= _MISSED:
                self._asked[kind] = now
                ask = (MavCommand.SET_INTERVAL, 0, float(kind), period * 1e6)
                out.append(CommandLong(self._peer.address, *ask))
        return out

    def _ask_for_an_item(self, now: float) -> Sequence[Message]:
        """Read the mission again, an item at a time, where that disturbs nobody.

        ArduPilot has no number for its mission, and answers each request by itself.
        """
        if not self._peer.manners.any_request_order or now < self._next_check:
            return ()
        self._next_check = now + 1.0
        seq, beyond = self._checked, self._checked + 1
        self._checked = beyond if beyond < len(self._rows) else self._home
        return [MissionRequestInt(self._peer.address, _MISSION, seq)]

    def _end(self, kind: Kind, text: str) -> None:
        if self.outcome is None:
            self.outcome = Ending(kind, text)


_MISSION = MissionType.MISSION
