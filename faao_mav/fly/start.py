"""Arming a vehicle and starting its mission, where that is asked for, and having it hold."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from faao_mav.fly.readiness import Readiness
from faao_mav.fly.telemetry import PATIENCE, Ending
from faao_mav.fly.watch import Watch
from faao_mav.wire.messages import CommandAck, CommandLong, Heartbeat, Message, WireItem
from faao_mav.wire.protocol import LOCAL_POSITION, MavCommand, command_result
from faao_mav.wire.transfer.exchange import Peer

ACCEPTED, _IN_PROGRESS = 0, 5
"""MAV_RESULT."""

_LISTEN = 2.0
"""Seconds of listening for other ground stations before anything is started: two heartbeats."""

_AGAIN, _TRIES = 1.5, 5
"""Seconds after which an order that is not carried out is repeated, and how often: as the MAVLink
guide has it for missions."""

_WORDS = 1.0
"""Seconds for which what the vehicle says of an arming that it denies is waited for; chosen."""


@dataclass(slots=True)
class Order:
    """A command that is repeated until it is carried out.

    `due` is when it is sent next, s; `answer` is what became of it, in words.
    """

    command: MavCommand
    params: tuple[float, ...]
    due: float
    sent: int = 0
    refusals: int = 0
    answer: str = "does not answer"


class Start(Watch):
    """A watch that arms the vehicle and starts its mission.

    It does once the autopilot's own checks pass, it knows where it is, no other ground station was
    heard and the gate before the flight, `readiness`, finds no error; after `PATIENCE` seconds of
    checks that do not pass it ends. Nothing is ever sent again, but what asks for telemetry, once
    the mode is one that was not asked for: then the pilot, or a failsafe, has the aircraft.

    `cancel` asks a flight that was started here to hold, and again until it does or a pilot has it,
    however long the link is silent; a second time it leaves it. `hang_up` leaves a mission to the
    autopilot. What was armed, and did not start, is asked to disarm until it has.

    The phases before those of a watch: "checking", "engaging" (a `Stream` only), "arming" and
    "starting", or "disarming"; "holding", as `cancel` asked for.
    """

    def __init__(
        self, peer: Peer, rows: Sequence[WireItem], readiness: Readiness, **options: Any
    ) -> None:
        super().__init__(peer, rows, readiness, **options)
        self._readiness = readiness
        self.seen.ask_for(LOCAL_POSITION, 1.0)
        self.phase = "checking"
        self._order: Order | None = None
        self._asked: set[int | None] = set()
        """Modes in which it may be meanwhile: any other was set by somebody else."""
        self._before = -1
        self._begun, self._said_before, self._unattended = 0.0, 0, False
        self._then = Ending("refused", "")

    def start(self, now: float) -> Sequence[Message]:
        """Listen, and ask for telemetry."""
        self._begun = now
        return super().start(now)

    def cancel(self, now: float) -> Sequence[Message]:
        """Ask the flight to hold, or leave it: what has been asked for is told."""
        asked = self._order is not None
        if self.phase in ("starting", "flying") or (self.phase == "ending" and asked):
            return self._ask_to_hold(now)
        if self.phase == "arming":
            return self._disarm(Ending("left", "interrupted before the start"), now)
        if self.phase == "disarming":
            self._leave_armed("interrupted again")
        super().cancel(now)
        if self.phase == "holding" and asked and self.outcome is not None:
            text = f"{self.outcome.text}, and has not confirmed that it holds"
            self.outcome = replace(self.outcome, text=text)
        return self._readiness.cancel(now)

    def hang_up(self, now: float) -> Sequence[Message]:
        """Leave a mission that is under way to the autopilot, cancel anything else.

        A flight by setpoints is to hold: it needs this end. What is not confirmed is waited for.
        """
        self._unattended = True
        if self._order is not None and self.phase in ("holding", "ending", "disarming"):
            return ()
        leaves = not self.streams and self.phase not in ("arming", "starting")
        return super().hang_up(now) if leaves else self.cancel(now)

    def _hear(self, message: Message, now: float) -> Sequence[Message]:
        order = self._order
        match message:
            case CommandAck(target, command, result) if self._peer.own.takes(target):
                if order is not None and command == order.command and result != _IN_PROGRESS:
                    return self._answered(order, result, now)
            # A first heartbeat may be from before the order.
            case Heartbeat(armed=False) if self.phase == "disarming" and order is not None:
                if self._armed or order.sent > 1:
                    self._end(self._then.kind, f"{self._then.text}; it is disarmed{self._words}")
        return super()._hear(message, now)

    def _time_out(self, now: float) -> Sequence[Message]:
        out = super()._time_out(now)
        over = self.phase in ("holding", "ending", "aside") and self._order is None
        if self._unattended and over:
            self._end("left", f"the terminal has gone; the vehicle is in mode {self.seen.mode}")
        if self.outcome is not None:
            return out
        return [*out, *(self._check(now) if self.phase == "checking" else self._repeat(now))]

    # ---- what the vehicle does

    def _on_mode(self, mode: int, now: float) -> Sequence[Message]:
        if self.phase not in ("arming", "starting", "disarming", "holding"):
            return super()._on_mode(mode, now)
        if mode not in self._asked:
            self._step_aside()
        elif self.phase == "starting" and self._armed and mode == self._modes.mission:
            self._begin()
        elif self.phase == "holding" and mode != self._before and self._order is not None:
            self._asked.discard(self._before)  # the start that was asked for has come
            if mode == self._modes.hold:
                self._order, self._asked, self.seen.patience = None, {mode}, PATIENCE
                self.seen.told.append("it holds; interrupt again to leave it")
        return ()

    def _answered(self, order: Order, result: int, now: float) -> Sequence[Message]:
        """Go on, or end, now that an order is answered.

        Arming that is denied is not asked for again: what is said about it is waited for.
        """
        order.answer = f"answers {order.command.name} with {command_result(result)}"
        accepted = result == ACCEPTED
        order.refusals += not accepted
        match self.phase:
            case "arming" if accepted:
                return self._start(now)
            case "arming":
                order.sent, order.due = _TRIES, now + _WORDS
            case "starting" if not accepted:
                return self._refused(order, now)
            case "disarming" if order.refusals == _TRIES:
                self._leave_armed(f"it {order.answer}")
        return ()

    def _begin(self) -> None:
        self._order = None
        super()._begin()

    def _on_disarmed(self) -> None:
        if self.phase == "holding":
            self._end("held", "disarmed after it was asked to hold")
        elif self.phase in ("arming", "starting"):
            self._end("refused", f"the vehicle disarmed before the mission began{self._words}")
        super()._on_disarmed()

    def _step_aside(self) -> None:
        if self.phase == "disarming":
            self._leave_armed(f"the pilot or a failsafe has it, in mode {self.seen.mode}")
        self._order = None
        super()._step_aside()

    # ---- what it is told

    def _check(self, now: float) -> Sequence[Message]:
        """Arm, if there is nothing against it."""
        seen, waited = self.seen, now - self._begun
        self._readiness.judge(seen, now)
        if self._stopped():
            return ()
        lacks = self._lacks(now)
        if waited >= PATIENCE:
            said = "; ".join(dict.fromkeys(seen.said)) or lacks or "it does not say why"
            self._end("refused", f"its own checks do not pass in {waited:.0f} s: {said}")
            return ()
        may_arm = seen.status is not None and seen.status.may_arm and seen.current is not None
        if waited < _LISTEN or lacks or not may_arm:
            return ()
        out = self._readiness.settle(seen, now)
        if out is not None:
            return out
        return () if self._stopped() or self._readiness.errors else self._set_out(now)

    def _lacks(self, now: float) -> str:  # noqa: ARG002
        """Return what it does not know that it has to, in words."""
        return "" if self.seen.knows_place else "it does not know where it is"

    def _stopped(self) -> bool:
        """End where the gate has found an error, and tell whether it has.

        A place that is not known is waited for.
        """
        errors = [each for each in self._readiness.errors if each.rule != "position-unknown"]
        if errors:
            contested = any(each.rule == "ground-station" for each in errors)
            told = "; ".join(f"{each.message} ({each.action})" for each in errors)
            self._end("contested" if contested else "refused", f"nothing was started: {told}")
        return bool(errors)

    def _set_out(self, now: float) -> Sequence[Message]:
        """Arm, now that nothing is against it."""
        self.seen.told.append(f"its own checks pass: arming, and starting {self.seen.items} items")
        return self._arm(self.seen.custom_mode, now)

    def _arm(self, mode: int, now: float) -> Sequence[Message]:
        self.phase, self._before, self._asked = "arming", mode, {mode}
        return self._say(now, MavCommand.ARM, 1.0)

    def _start(self, now: float) -> Sequence[Message]:
        self.phase = "starting"
        self._asked.add(self._modes.mission)
        return self._say(now, MavCommand.START)

    def _ask_to_hold(self, now: float) -> Sequence[Message]:
        """Ask the vehicle to hold, until it does."""
        if self.phase != "starting" or self.streams:
            self._before = -1
        self._asked = {self._before, self._modes.mission, self._modes.hold}
        self.phase, self.seen.patience = "holding", math.inf
        self.seen.told.append("asking the vehicle to hold; interrupt again to leave it")
        return self._set_mode(now, self._modes.hold)

    def _set_mode(self, now: float, mode: int) -> Sequence[Message]:
        return self._say(now, MavCommand.SET_MODE, *self._family.mode_parameters(mode))

    def _say(self, now: float, command: MavCommand, *params: float) -> Sequence[Message]:
        """Give an order, and repeat it until it is answered."""
        self._order = Order(command, params, now)
        if self.phase != "disarming":
            self._said_before = len(self.seen.said)
        return self._repeat(now)

    def _repeat(self, now: float) -> Sequence[Message]:
        order = self._order
        if order is None or now < order.due:
            return ()
        if order.sent == _TRIES and self.phase == "holding":
            text = f"it does not confirm that it holds, it {order.answer}: it is asked again"
            self.seen.told.append(f"{text} until then")
        if order.sent >= _TRIES and self.phase in ("engaging", "arming", "starting"):
            return self._refused(order, now)
        again = min(order.sent, 255)
        order.sent, order.due = order.sent + 1, now + _AGAIN
        return [CommandLong(self._peer.address, order.command, again, *order.params)]

    # ---- when it does not start

    def _refused(self, order: Order, now: float) -> Sequence[Message]:
        """End before the start; an aircraft that is armed, or may be, disarms first."""
        then = Ending("refused", f"the vehicle {order.answer}")
        unsure = self.phase == "arming" and not order.refusals
        if unsure or self._armed or self.phase == "starting":
            return self._disarm(then, now)
        self._end(then.kind, f"{then.text}{self._words}")
        return ()

    @property
    def _words(self) -> str:
        """What it has said since the last order, as the end of a sentence."""
        said = dict.fromkeys(self.seen.said[self._said_before :])
        return f". It says: {'; '.join(said)}" if said else ""

    def _disarm(self, then: Ending, now: float) -> Sequence[Message]:
        """Have it disarm, and end with `then`."""
        self.phase, self._then = "disarming", then
        self._asked = {self.seen.custom_mode, self._modes.mission, self._modes.guided}
        self.seen.told.append(f"{then.text}: it is asked to disarm")
        return self._say(now, MavCommand.ARM, 0.0)

    def _leave_armed(self, why: str) -> None:
        """End, though it may still be armed."""
        text = f"{self._then.text}; it may still be armed: {why}{self._words}"
        self._end(self._then.kind, text)

    def _end_as_heard(self, now: float) -> Sequence[Message]:
        """End where what was heard says so; what may be armed is disarmed whatever that is."""
        ending = self.seen.ending
        if ending is not None and ending.kind == "changed" and self.phase in ("arming", "starting"):
            return self._disarm(ending, now)
        if ending is None or self.phase != "disarming":
            return super()._end_as_heard(now)
        if ending.kind == "lost":
            self._leave_armed(f"nothing was heard for {self.seen.patience:.0f} s")
        return ()
