"""Watching a mission from the ground to its end, and starting it where that is asked for."""

import math
from collections.abc import Callable, Sequence
from typing import Literal, TypeAlias

from faao_mav.fly.disarm import Disarm
from faao_mav.fly.readiness import Readiness
from faao_mav.fly.telemetry import POSITION_RATE, Ending, Kind, Telemetry
from faao_mav.validate.rule import Finding
from faao_mav.wire.machine import Machine, Progress
from faao_mav.wire.messages import (
    CommandAck,
    CommandLong,
    Envelope,
    Heartbeat,
    Message,
    MissionCurrent,
    WireItem,
)
from faao_mav.wire.protocol import (
    LOCAL_POSITION,
    MISSION_COMPLETE,
    MavCommand,
    MissionType,
    command_result,
)
from faao_mav.wire.transfer.exchange import Peer
from faao_mav.wire.wire_items import home_items

Phase: TypeAlias = Literal[
    "checking", "engaging", "arming", "starting", "disarming", "waiting", "flying", "holding",
    "ending", "aside",
]  # fmt: skip

ACCEPTED, IN_PROGRESS = 0, 5
"""MAV_RESULT."""

_TICK = 0.5
"""Seconds between two looks at what is due; chosen."""

_LISTEN = 2.0
"""Seconds of listening for other ground stations before anything is started: two of their
heartbeats."""

_AGAIN, _TRIES = 1.5, 5
"""Seconds after which a command without an answer is repeated, and how often it is sent: as the
MAVLink guide has it for missions."""

_WORDS = 1.0
"""Seconds for which what the vehicle says of a denial is waited for; chosen."""

_REBOOT = 1.5
"""Seconds in which a vehicle that is not armed any more can show that it has rebooted; chosen."""

_LATE_NEWS = 3.0
"""Seconds after a change of mode in which the last item may still be told to be under way: then it
was the mission that changed it. Chosen: three of the messages that tell the item."""

_FIRST_DO = 176
"""From this command on an item is no place to fly to or to wait at."""


class Watch(Machine[Ending]):
    """A machine that watches the vehicle of `peer` fly the mission `rows` to its end.

    `rows` are the items that it holds, the home row included where it has one. With `arm` it arms
    and starts the mission once the autopilot's own checks pass, it knows where it is, no other
    ground station was heard and the gate before the flight, `readiness`, finds no error; else
    somebody else does. `lands`: the flight ends on the ground.
    After `patience` seconds without a message, or of checks that do not pass, it ends. `seen` is
    what it has heard; it asks for `rate` positions a second. `relay_start` is when the plan's clock
    read 0, s on the vehicle's, where that is known: in a `Stream`.

    Nothing is sent but what asks for telemetry, until `arm` or `cancel` has a reason; and nothing
    ever again once the mode is one that was not asked for: then the pilot, or a failsafe, has the
    aircraft. `cancel` asks a flight that was started here to hold, and again until it does or a
    pilot has it, however long the link is silent; a second time, and in any other flight, it
    leaves, and says how. `hang_up` leaves a mission to the autopilot.

    The phases: "checking", "engaging" (a `Stream` only), "arming" and "starting", with `arm`, or
    "waiting" for others to start it; "disarming", where it did not start; "flying" the mission;
    "ending", when that is over; "holding", as `cancel` asked for; "aside", when the pilot has the
    aircraft. Raises `ValueError` for a vehicle that is not known, and where `readiness` is missing
    with `arm`.
    """

    streams = False
    """Whether it is not the mission that is flown, but a plan by setpoints."""

    _start_command = MavCommand.START

    def __init__(
        self,
        peer: Peer,
        rows: Sequence[WireItem],
        *,
        arm: bool = False,
        lands: bool = True,
        patience: float = 60.0,
        rate: float = POSITION_RATE,
        readiness: Readiness | None = None,
    ) -> None:
        super().__init__()
        if peer.vehicle is None:
            raise ValueError("watch: a vehicle that is known is needed")
        if arm and readiness is None:
            raise ValueError("watch: nothing is armed without the gate before a flight")
        self._peer, self._modes = peer, peer.vehicle.modes
        self._family = peer.vehicle.family
        self._first = home_items(peer.vehicle, MissionType.MISSION)
        places = [n for n, row in enumerate(rows) if row.command < _FIRST_DO]
        self._last = max(places, default=len(rows) - 1)
        self._arm, self._lands, self._patience = arm, lands, patience
        self.seen = Telemetry(peer, rows, patience, rate)
        if arm:
            self.seen.ask_for(LOCAL_POSITION, 1.0)
        self.phase: Phase = "checking" if arm else "waiting"
        self.relay_start: float | None = None
        self._begun = 0.0
        self._furthest = 0
        self._armed = False
        self._aside_since = float("-inf")
        self._disarmed_at: float | None = None
        self._mode_before = -1
        self._command: Callable[[], Message] | None = None
        self._sent, self._next_try, self._no = 0, 0.0, ""
        self._said_before, self._denied_at = 0, math.inf
        self._unattended = False
        self._disarming: Disarm | None = None
        self._ready = readiness

    @property
    def findings(self) -> tuple[Finding, ...] | None:
        """What the gate before the flight found, None before it has looked."""
        return None if self._ready is None else self._ready.findings

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        own, reading = super().deadline, None if self._ready is None else self._ready.deadline
        return own if own is None or reading is None else min(own, reading)

    @property
    def progress(self) -> Progress:
        """What is going on, at which item of how many."""
        return f"watching ({self.phase})", self.seen.row or 0, self.seen.items

    def start(self, now: float) -> Sequence[Message]:
        """Listen, and ask for telemetry."""
        self._begun = now
        self.seen.start(now)
        if self._ready is not None:
            self._ready.start(now)
        return self._time_out(now)

    def cancel(self, now: float) -> Sequence[Message]:
        """Ask the flight to hold, or leave it: what has been asked for is told."""
        unfinished = self.phase == "ending" and self._command is not None
        if self._arm and (self.phase in ("starting", "flying") or unfinished):
            return self._ask_to_hold(now)
        if self.phase == "arming":
            return self._disarm(Ending("left", "interrupted before the start"), now)
        if self._disarming is not None:
            self._disarming.leave("interrupted again")
            self._disarmed_by((), self._disarming)
        self._end("left", f"no longer watched: {self._left_behind(now)}")
        return () if self._ready is None else self._ready.cancel(now)

    def hang_up(self, now: float) -> Sequence[Message]:
        """Leave a mission that is under way to the autopilot, cancel anything else.

        A flight by setpoints is to hold: it needs this end. What is not confirmed is waited for.
        """
        self._unattended = True
        waits = self.phase in ("holding", "ending") and self._command is not None
        if waits or self._disarming is not None:
            return ()
        if self.streams or self.phase in ("arming", "starting"):
            return self.cancel(now)
        self._end("left", f"the terminal has gone; the vehicle goes on in mode {self.seen.mode}")
        return ()

    def _ask_to_hold(self, now: float) -> Sequence[Message]:
        """Ask the vehicle to hold, until it does."""
        if self.phase != "starting" or self.streams:
            self._mode_before = -1
        self.phase, self.seen.patience = "holding", math.inf
        self.seen.told.append("asking the vehicle to hold; interrupt again to leave it")
        return self._say(self._hold, now)

    def _left_behind(self, now: float) -> str:
        """Return in words what is known of the vehicle."""
        armed = "armed" if self._armed else "not armed"
        asked = self.phase == "holding" and self._command is not None
        unconfirmed = ", and has not confirmed that it holds" if asked else ""
        return f"it is {armed}, {self.seen.where(now)}{unconfirmed}"

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        self.seen.hear(envelope, now)
        if self._disarming is not None:
            return self._disarmed_by(self._disarming.on(envelope, now), self._disarming)
        if self.seen.ending is not None:
            return self._end_early(self.seen.ending, now)
        if envelope.sender != self._peer.address:
            return ()
        out = () if self._ready is None else self._ready.on(envelope, now)
        return [*out, *self._hear(envelope.message, now)]

    def _hear(self, message: Message, now: float) -> Sequence[Message]:
        match message:
            case Heartbeat() as heartbeat:
                return self._on_heartbeat(heartbeat, now)
            case MissionCurrent() as current:
                self._on_current(current, now)
            case CommandAck(target, command, result) if self._peer.own.takes(target):
                return self._on_ack(command, result, now)
        return ()

    def _time_out(self, now: float) -> Sequence[Message]:
        self._due = now + _TICK
        questions = self.seen.tick(now)
        if self._disarming is not None:
            return [*questions, *self._disarmed_by(self._disarming.tick(now), self._disarming)]
        if self.seen.ending is not None:
            return self._end_early(self.seen.ending, now)
        over = self.phase in ("holding", "ending", "aside") and self._command is None
        if self._unattended and over:
            self._end("left", f"the terminal has gone; the vehicle is in mode {self.seen.mode}")
            return ()
        if self._disarmed_at is not None and now >= self._disarmed_at + _REBOOT:
            self._disarmed_at = None
            return self._on_disarmed()
        if now >= self._denied_at + _WORDS and self.phase == "arming":
            return self._refused(self._no, now)
        if self._ready is not None and self.phase in ("checking", "waiting"):
            self._ready.look(self.seen, now)
        if self.phase == "checking":
            return [*questions, *self._check(now)]
        return [*questions, *self._repeat(now)]

    # ---- what the vehicle does

    def _on_current(self, current: MissionCurrent, now: float) -> None:
        if self.phase in ("flying", "holding", "ending"):
            self._furthest = max(self._furthest, current.seq)
        late_news = self.phase == "aside" and now < self._aside_since + _LATE_NEWS
        if late_news and current.seq >= self._last > self._furthest:
            self.seen.told.append("it is the mission that changed the mode, at its last item")
            self._furthest = current.seq
            self._over()
        if current.mission_state == MISSION_COMPLETE and self.phase == "flying":
            self._over()

    def _on_heartbeat(self, heartbeat: Heartbeat, now: float) -> Sequence[Message]:
        if self._armed != heartbeat.armed:
            self._armed = heartbeat.armed
            self._disarmed_at = None if self._armed else now
        return self._on_mode(heartbeat.custom_mode, now)

    def _on_mode(self, mode: int, now: float) -> Sequence[Message]:
        mission, hold = self._modes.mission, self._modes.hold
        match self.phase:
            case "arming" if mode != self._mode_before:
                self._step_aside()
            case "starting" if mode not in (self._mode_before, mission):
                self._step_aside()
            case "starting" | "waiting" if self._armed and mode == mission:
                self.phase, self._command = "flying", None
                self.seen.told.append("the mission is under way")
            case "flying" if mode != mission and self._furthest >= self._last:
                self._over()  # the last item has a mode of its own, as PX4's return
            case "flying" if mode != mission:
                self._aside_since = now
                self._step_aside()
            case "holding" if mode == mission and self._command is not None:
                self._mode_before = -1
            case "holding" if mode == self._mode_before:
                pass  # the start that was asked for may still be to come
            case "holding" if mode == hold and self._command is not None:
                self._command, self.seen.patience = None, self._patience
                self.seen.told.append("it holds; interrupt again to leave it")
            case "holding" if mode != hold:
                self._step_aside()
        return ()

    def _on_ack(self, command: int, result: int, now: float) -> Sequence[Message]:
        awaited = {"arming": MavCommand.ARM, "starting": self._start_command}.get(self.phase)
        if command == MavCommand.SET_MODE and result not in (ACCEPTED, IN_PROGRESS):
            self._no = _answer(command, result)  # the mode itself tells whether it was taken
        if command != awaited or result == IN_PROGRESS:
            return ()
        return self._accepted(now) if result == ACCEPTED else self._denied(command, result, now)

    def _accepted(self, now: float) -> Sequence[Message]:
        """Go on, now that arming or starting has been accepted."""
        if self.phase != "arming":
            return ()
        self.phase = "starting"
        return self._say(self._starting, now)

    def _denied(self, command: int, result: int, now: float) -> Sequence[Message]:
        """End, now that arming or starting has been denied; what it says of it may come later."""
        self._no = _answer(command, result)
        if self.phase == "starting":
            return self._refused(self._no, now)
        self._command, self._denied_at = None, now
        return ()

    def _on_disarmed(self) -> Sequence[Message]:
        match self.phase:
            case "flying" if self._furthest < self._last:
                text = f"disarmed at item {self.seen.row}, before the end of the mission"
                self._end("taken over", text)
            case "flying" | "ending":
                self._end("finished", "landed and disarmed at the end of the mission")
            case "holding":
                self._end("held", "disarmed after it was asked to hold")
            case "aside":
                self._end("taken over", "disarmed; it was not the mission that flew it last")
            case "arming" | "starting":
                self._end("refused", f"the vehicle disarmed before the mission began{self._words}")
        return ()

    def _over(self) -> None:
        """The mission is done; what is left is the landing, if there is one."""
        self.phase = "ending"
        if not self._lands:
            self._end("finished", f"the mission is over; the vehicle is in mode {self.seen.mode}")

    def _step_aside(self) -> None:
        at_end = self.phase == "flying" and not self.streams and self._furthest >= self._last - 1
        who = "the pilot or a failsafe has the aircraft"
        if at_end:  # as PX4's return is a mode of its own
            who = "the mission is at its end, or the pilot or a failsafe has the aircraft"
        self.phase, self._command = "aside", None
        self.seen.patience = self._patience
        self.seen.told.append(f"mode {self.seen.mode}: {who}; nothing more is sent")

    # ---- what it is told

    def _check(self, now: float) -> Sequence[Message]:
        """Arm, if there is nothing against it."""
        seen, waited = self.seen, now - self._begun
        beat, current = seen.heartbeat, seen.current
        if beat is not None and beat.armed:
            self._end("refused", "it is armed already: watch it without --arm")
        elif seen.stations:
            names = "; ".join(sorted(seen.stations))
            self._end("contested", f"nothing was started: another ground station ({names})")
        elif seen.strangers:
            text = f"its number is used by another vehicle too, at {', '.join(seen.strangers)}"
            self._end("refused", f"nothing was started: {text}")
        elif self._last >= 0 and current is not None and current.seq > self._first:
            text = f"it would go on at item {seen.row}, not at the beginning"
            self._end("refused", f"nothing was started: {text}; set the first item (or reboot)")
        elif self._stopped():
            pass
        elif waited >= self._patience:
            silent = "it does not say why" if seen.knows_place else "it does not know where it is"
            said = "; ".join(dict.fromkeys(seen.said)) or silent
            self._end("refused", f"its own checks do not pass in {waited:.0f} s: {said}")
        if self.outcome is not None or waited < _LISTEN or beat is None or current is None:
            return ()
        if seen.status is None or not (seen.status.may_arm and seen.knows_place):
            return ()
        if self._ready is not None:
            out = self._ready.settle(seen, now)
            if out is not None:
                return out
            if self._stopped() or self._ready.errors:
                return ()
        self._mode_before = beat.custom_mode
        return self._set_out(now)

    def _stopped(self) -> bool:
        """End where the gate has found an error, and tell whether it has.

        A place that is not known is waited for.
        """
        errors = () if self._ready is None else self._ready.errors
        told = [f"{e.message} ({e.action})" for e in errors if e.rule != "position-unknown"]
        if told:
            self._end("refused", f"nothing was started: {'; '.join(told)}")
        return bool(told)

    def _set_out(self, now: float) -> Sequence[Message]:
        """Arm, now that nothing is against it."""
        self.phase = "arming"
        self.seen.told.append(f"its own checks pass: arming, and starting {self.seen.items} items")
        return self._say(lambda: self._arming(True), now)

    def _arming(self, wanted: bool) -> Message:
        return CommandLong(
            self._peer.address, MavCommand.ARM, max(0, self._sent - 1), float(wanted)
        )

    def _starting(self) -> Message:
        return CommandLong(self._peer.address, self._start_command, max(0, self._sent - 1))

    def _hold(self) -> Message:
        return self._mode(self._modes.hold)

    def _mode(self, mode: int) -> Message:
        again = max(0, self._sent - 1)
        params = self._family.mode_parameters(mode)
        return CommandLong(self._peer.address, MavCommand.SET_MODE, again, *params)

    def _say(self, command: Callable[[], Message], now: float) -> Sequence[Message]:
        """Send `command`, and repeat it until it is answered."""
        self._command, self._sent, self._next_try = command, 0, now
        self._no, self._said_before = "does not answer", len(self.seen.said)
        return self._repeat(now)

    def _repeat(self, now: float) -> Sequence[Message]:
        if self._command is None or now < self._next_try:
            return ()
        if self._sent == _TRIES and self.phase == "holding":
            text = f"it does not confirm that it holds, it {self._no}: it is asked again until then"
            self.seen.told.append(text)
        if self._sent >= _TRIES and self.phase not in ("ending", "holding"):
            return self._refused(self._no, now, unsure=self.phase == "arming")
        self._sent, self._next_try = self._sent + 1, now + _AGAIN
        return [self._command()]

    # ---- when it does not start

    def _refused(self, why: str, now: float, *, unsure: bool = False) -> Sequence[Message]:
        """End before the start; an aircraft that is armed, or may be (`unsure`), disarms first."""
        if unsure or self._armed or self.phase == "starting":
            return self._disarm(Ending("refused", f"the vehicle {why}"), now)
        self._end("refused", f"the vehicle {why}{self._words}")
        return ()

    @property
    def _words(self) -> str:
        """What it has said since the last command, as the end of a sentence."""
        said = dict.fromkeys(self.seen.said[self._said_before :])
        return f". It says: {'; '.join(said)}" if said else ""

    def _disarm(self, then: Ending, now: float) -> Sequence[Message]:
        """Have it disarm, and end with `then`."""
        self.phase = "disarming"
        self.seen.told.append(f"{then.text}: it is asked to disarm")
        beat = self.seen.heartbeat
        mode = self._mode_before if beat is None else beat.custom_mode
        modes = (mode, self._modes.mission, self._modes.guided)
        self._disarming = Disarm(self._peer, then, self._armed, modes, self._patience)
        return self._disarming.start(now)

    def _disarmed_by(self, out: Sequence[Message], disarming: Disarm) -> Sequence[Message]:
        """Return `out`; end once `disarming` has, with what the vehicle says of it."""
        if (ending := disarming.outcome) is not None:
            self._end(ending.kind, f"{ending.text}{self._words}")
        return out

    def _end_early(self, ending: Ending, now: float) -> Sequence[Message]:
        """End as what was heard says, disarmed where it was about to start another mission."""
        if ending.kind == "changed" and self.phase in ("arming", "starting"):
            return self._disarm(ending, now)
        self._end(ending.kind, ending.text)
        return ()

    def _end(self, kind: Kind, text: str) -> None:
        if self.outcome is None:
            self.outcome = Ending(kind, text)


def _answer(command: int, result: int) -> str:
    return f"answers {MavCommand(command).name} with {command_result(result)}"
