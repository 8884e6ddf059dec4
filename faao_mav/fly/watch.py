"""Watching a mission from the ground to its end."""

from collections.abc import Sequence
from typing import Literal, TypeAlias

from faao_mav.fly.readiness import Readiness
from faao_mav.fly.telemetry import PATIENCE, POSITION_RATE, Ending, Kind, Telemetry
from faao_mav.validate.rule import Finding
from faao_mav.wire.machine import Machine, Progress
from faao_mav.wire.messages import Envelope, Heartbeat, Message, MissionCurrent, WireItem
from faao_mav.wire.protocol import MISSION_COMPLETE
from faao_mav.wire.transfer.exchange import Peer

Phase: TypeAlias = Literal[
    "checking", "engaging", "arming", "starting", "disarming", "waiting", "flying", "holding",
    "ending", "aside",
]  # fmt: skip

_TICK, _REBOOT = 0.5, 1.5
"""Seconds between two looks at what is due, and in which a vehicle that is not armed any more can
show that it has rebooted; chosen."""

_LATE_NEWS = 3.0
"""Seconds after a change of mode in which the last item may still be told to be under way: then it
was the mission that changed it. Chosen: three of the messages that tell the item."""

_FIRST_DO = 176
"""From this command on an item is no place to fly to or to wait at."""


class Watch(Machine[Ending]):
    """A machine that watches the vehicle of `peer` fly the mission `rows` to its end.

    `rows` are the items that it holds, the home row included where it has one. `lands`: the flight
    ends on the ground. After `PATIENCE` seconds without a message it ends. `seen` is what it has
    heard; it asks for `rate` positions a second. Nothing else is sent: somebody else arms and
    starts it. What stands against that, `readiness` says meanwhile, where it is given.

    The phases: "waiting" for others to start it; "flying" the mission; "ending", when that is over;
    "aside", when somebody else has the aircraft. Those between are of a `Start`.
    """

    streams = False
    """Whether it is not the mission that is flown, but a plan by setpoints."""

    def __init__(
        self,
        peer: Peer,
        rows: Sequence[WireItem],
        readiness: Readiness | None = None,
        *,
        lands: bool = True,
        rate: float = POSITION_RATE,
    ) -> None:
        super().__init__()
        assert peer.vehicle is not None
        self._peer, self._modes, self._family = peer, peer.vehicle.modes, peer.vehicle.family
        places = [n for n, row in enumerate(rows) if row.command < _FIRST_DO]
        self._last = max(places, default=len(rows) - 1)
        self._lands, self._ready = lands, readiness
        self.seen = Telemetry(peer, rows, rate)
        self.phase: Phase = "waiting"
        self.relay_start: float | None = None
        """When the plan's clock read 0, s on the vehicle's, where that is known."""
        self._furthest, self._armed = 0, False
        self._aside_since, self._disarmed_at = float("-inf"), float("inf")

    @property
    def findings(self) -> tuple[Finding, ...] | None:
        """What the gate before the flight found, None before it has looked."""
        return None if self._ready is None else self._ready.findings

    @property
    def progress(self) -> Progress:
        """What is going on, at which item of how many."""
        return f"watching ({self.phase})", self.seen.row or 0, self.seen.items

    def start(self, now: float) -> Sequence[Message]:
        """Listen, and ask for telemetry."""
        self.seen.start(now)
        if self._ready is not None:
            self._ready.begun = now
        return self._time_out(now)

    def cancel(self, now: float) -> Sequence[Message]:
        """Leave the flight, and say how."""
        armed = "armed" if self._armed else "not armed"
        self._end("left", f"no longer watched: it is {armed}, {self.seen.where(now)}")
        return ()

    def hang_up(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Leave the flight to the autopilot."""
        self._end("left", f"the terminal has gone; the vehicle goes on in mode {self.seen.mode}")
        return ()

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        self.seen.hear(envelope, now)
        out = [*self._end_as_heard(now)]
        if envelope.sender == self._peer.address and self.outcome is None:
            out += () if self._ready is None else self._ready.on(envelope, now)
            out += self._hear(envelope.message, now)
        return out

    def _hear(self, message: Message, now: float) -> Sequence[Message]:
        """Take note of what the vehicle tells."""
        match message:
            case Heartbeat(armed=armed, custom_mode=mode):
                if self._armed != armed:
                    self._disarmed_at = float("inf") if armed else now
                self._armed = armed
                return self._on_mode(mode, now)
            case MissionCurrent():
                self._on_current(message, now)
        return ()

    def _time_out(self, now: float) -> Sequence[Message]:
        self._due = now + _TICK
        out = [*self.seen.tick(now), *self._end_as_heard(now)]
        if now >= self._disarmed_at + _REBOOT:
            self._disarmed_at = float("inf")
            self._on_disarmed()
        if self._ready is not None and self.phase == "waiting" and not self._armed:
            self._ready.judge(self.seen, now)
        return out

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

    def _on_mode(self, mode: int, now: float) -> Sequence[Message]:
        match self.phase:
            case "waiting" if self._armed and mode == self._modes.mission:
                self._begin()
            case "flying" if mode != self._modes.mission and self._furthest >= self._last:
                self._over()  # the last item has a mode of its own, as PX4's return
            case "flying" if mode != self._modes.mission:
                self._aside_since = now
                self._step_aside()
        return ()

    def _begin(self) -> None:
        self.phase = "flying"
        self.seen.told.append("the mission is under way")

    def _on_disarmed(self) -> None:
        match self.phase:
            case "flying" if self._furthest < self._last:
                text = f"disarmed at item {self.seen.row}, before the end of the mission"
                self._end("taken over", text)
            case "flying" | "ending":
                self._end("finished", "landed and disarmed at the end of the mission")
            case "aside":
                self._end("taken over", "disarmed; it was not the mission that flew it last")

    def _over(self) -> None:
        """The mission is done; what is left is the landing, if there is one."""
        self.phase = "ending"
        if not self._lands:
            self._end("finished", f"the mission is over; the vehicle is in mode {self.seen.mode}")

    def _step_aside(self) -> None:
        """Send nothing more."""
        self.phase, self.seen.patience = "aside", PATIENCE
        who = "the pilot or a failsafe has the aircraft; nothing more is sent"
        self.seen.told.append(f"mode {self.seen.mode}: {who}")

    def _end_as_heard(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """End where what was heard says so."""
        self.outcome = self.seen.ending
        return ()

    def _end(self, kind: Kind, text: str) -> None:
        self.outcome = self.outcome or Ending(kind, text)
