"""Watching a flight from the ground to its end; arming and starting it, where that is asked for."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from faao_mav.errors import counted
from faao_mav.fly.preflight import Clearance
from faao_mav.fly.telemetry import PATIENCE, POSITION_RATE, Ending, Kind, Telemetry
from faao_mav.wire import messages, protocol
from faao_mav.wire.machine import Machine
from faao_mav.wire.messages import CommandLong, Envelope, Message
from faao_mav.wire.protocol import MavCommand, MissionType

Phase: TypeAlias = Literal[
    "checking", "engaging", "arming", "starting", "disarming", "waiting", "flying", "holding",
    "ending", "aside",
]  # fmt: skip

_AGAIN, _TRIES = 1.5, 5
"""Seconds after which an order that is not carried out is repeated, and how often: as the MAVLink
guide has it for missions."""

_ACCEPTED, _IN_PROGRESS = 0, 5  # MAV_RESULT.

_TICK, _REBOOT = 0.5, 1.5
"""Seconds between two looks at what is due, and in which a vehicle that is not armed any more can
show that it has rebooted; chosen."""

_LATE_NEWS = 3.0
"""Seconds after a change of mode in which the last item may still be told to be under way: then it
was the mission that changed it. Chosen: three of the messages that tell the item."""

_FIRST_DO = 176  # From this command on an item is no place to fly to or to wait at.

_LISTEN, _WORDS = 2.0, 1.0
"""Seconds of listening for other ground stations before anything is started: two heartbeats; and
for which what the vehicle says of an arming that it denies is waited for. Chosen."""

BEFORE = "waiting", "checking", "engaging", "arming", "starting"
"""The phases before the flight, whose orders are given up after some tries."""


@dataclass(slots=True)
class Order:
    """A command that is repeated until it is carried out.

    `due` is when it is sent next, s; `answer` is what became of it, in words.
    """

    command: MavCommand
    params: tuple[float, ...] = ()
    due: float = 0.0
    sent: int = 0
    refusals: int = 0
    answer: str = "does not answer"


class Watch(Machine[Ending]):
    """A machine that watches a vehicle fly the mission that it holds to its end.

    `gate` says which vehicle, and what stands against the flight until it begins. `lands`: it ends
    on the ground. `streams`: no mission is flown, but a plan by setpoints. `seen` is what it has
    heard; it asks for `rate` positions a second. `relay_start` is when the plan's clock read 0, s
    on the vehicle's, where that is known. After `PATIENCE` seconds without a message it ends.

    With `arm` it arms the vehicle, in another mode than the mission's, and starts that: once the
    autopilot's own checks pass, it knows where it is, no other ground station was heard, what it
    holds has been read again and the gate is clear. After `PATIENCE` seconds of checks that do not
    pass it ends. Nothing is ever sent again, but what asks for telemetry, once the mode is one that
    was not asked for: then the pilot, or a failsafe, has the aircraft. Without `arm` nothing else
    is sent at all.

    `cancel` asks a flight that was started here to hold, and again until it does or a pilot has it,
    however long the link is silent; a second time it leaves it, as any other flight. `hang_up`
    leaves a mission to the autopilot. What was armed, and did not start, is asked to disarm until
    it has.

    The phases: "waiting" for others to start it, or "checking", then those of its orders,
    "engaging" (set to a mode), "arming" and "starting", or "disarming"; "flying"; "ending", when
    the mission is over; "holding", as `cancel` asked for; "aside", when somebody else has the
    aircraft. In each the vehicle's mode is one of `_path`, which it goes along: any other was set
    by somebody else.
    """

    streams = False

    def __init__(
        self, gate: Clearance, *, arm: bool = False, lands: bool = True, rate: float = POSITION_RATE
    ) -> None:
        super().__init__()
        self.gate, self._peer, self._arms, self._lands = gate, gate.peer, arm, lands
        rows = () if self.streams else gate.held.lists[MissionType.MISSION]
        places = [n for n, row in enumerate(rows) if row.command < _FIRST_DO]
        self._last = max(places, default=len(rows) - 1)
        self.seen = Telemetry(self._peer, rows, rate)
        self._modes, self._family = self.seen.vehicle.modes, self.seen.vehicle.family
        if arm:
            self.seen.ask_for(protocol.LOCAL_POSITION, 1.0)
        self.phase: Phase = "checking" if arm else "waiting"
        self.relay_start: float | None = None
        self._flown = self._modes.mission  # the mode that flies it
        # The orders that are left to start it, one after the other.
        start: tuple[Phase, Order] = ("starting", Order(MavCommand.START))
        self._left: list[tuple[Phase, Order]] = [("arming", Order(MavCommand.ARM, (1.0,))), start]
        self._order: Order | None = None
        # The modes of this phase, in the order in which they come; none: any.
        self._path: tuple[int, ...] = ()
        self._furthest, self._unattended, self._aside_since = 0, False, -math.inf
        self._then = Ending("refused", "")
        # What is said once the present call returns; not said any more when an interrupt cuts that
        # short, as it may anywhere: no order is to follow it.
        self._out: list[Message] = []

    def start(self, now: float) -> Sequence[Message]:
        """Listen, and ask for telemetry."""
        self.seen.start(now)
        return self._time_out(now)

    def cancel(self, now: float) -> Sequence[Message]:
        """Ask the flight to hold, or leave it, and say how: what has been asked for is told."""
        self._out.clear()
        asked = self._order is not None
        begun = self._arms and self.phase in ("starting", "flying")
        if begun or (self.phase == "ending" and asked):
            self._ask_to_hold(now)
        elif self.phase == "arming":
            self._disarm(Ending("left", "interrupted before the start"), now)
        elif self.phase == "disarming":
            self._leave_armed("interrupted again")
        else:
            armed = "armed" if self.seen.armed else "not armed"
            doubt = ", and has not confirmed that it holds" if self._is_to_hold else ""
            self._end("left", f"no longer watched: it is {armed}, {self.seen.where(now)}{doubt}")
            self._out += () if self.gate.reading is None else self.gate.reading.cancel(now)
        return self._said()

    def hang_up(self, now: float) -> Sequence[Message]:
        """Leave a mission that is under way to the autopilot, cancel anything else.

        A flight by setpoints is to hold: it needs this end. What is not confirmed is waited for.
        """
        self._out.clear()
        self._unattended = True
        if self._order is not None and self.phase in ("holding", "ending", "disarming"):
            return ()
        if self.streams or self.phase in ("arming", "starting"):
            return self.cancel(now)
        self._end("left", f"the terminal has gone; the vehicle goes on in mode {self.seen.mode}")
        return ()

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        self.seen.hear(envelope, now)
        self._end_as_heard(now)
        if envelope.sender == self._peer.address and self.outcome is None:
            self._out += () if self.gate.reading is None else self.gate.reading.on(envelope, now)
            self._hear(envelope.message, now)
        return self._said()

    def _time_out(self, now: float) -> Sequence[Message]:
        self._due = now + _TICK
        self._look(now)
        return self._said()

    def _said(self) -> list[Message]:
        said, self._out = self._out, []
        return said

    def _hear(self, message: Message, now: float) -> None:
        order = self._order
        match message:
            case messages.CommandAck(target, command, result) if self._peer.own.takes(target):
                if order is not None and command == order.command and result != _IN_PROGRESS:
                    self._answered(order, result, now)
            case messages.Heartbeat(armed=armed, custom_mode=mode):
                # A first heartbeat may be from before the order.
                told = self.seen.disarmed_at == now or (order is not None and order.sent > 1)
                if self.phase == "disarming" and told and not armed:
                    self._end(self._then.kind, f"{self._then.text}; it is disarmed{self._words}")
                self._on_mode(mode, now)
            case messages.MissionCurrent() if not self.streams:
                self._on_current(message, now)

    def _look(self, now: float) -> None:
        self._out += self.seen.tick(now, math.inf if self._is_to_hold else PATIENCE)
        self._end_as_heard(now)
        if now >= self.seen.disarmed_at + _REBOOT:
            self.seen.disarmed_at = math.inf
            self._on_disarmed()
        over = self.phase in ("holding", "ending", "aside") and self._order is None
        if self._unattended and over:
            self._end("left", f"the terminal has gone; the vehicle is in mode {self.seen.mode}")
        if self.outcome is not None:
            return
        if self.phase == "checking" or (self.phase == "waiting" and not self.seen.armed):
            self.gate.judge(self.seen, now)
        if self.phase == "checking":
            self._check(now)
        else:
            self._repeat(now)

    # ---- what the vehicle does

    def _on_current(self, current: messages.MissionCurrent, now: float) -> None:
        if self.phase in ("flying", "holding", "ending"):
            self._furthest = max(self._furthest, current.seq)
        late_news = self.phase == "aside" and now < self._aside_since + _LATE_NEWS
        if late_news and current.seq >= self._last > self._furthest:
            self.seen.told.append("it is the mission that changed the mode, at its last item")
            self._furthest = current.seq
            self._over()
        if current.mission_state == protocol.MISSION_COMPLETE and self.phase == "flying":
            self._over()

    def _on_mode(self, mode: int, now: float) -> None:
        if self.phase == "engaging" and self.seen.armed:
            self._step_aside()
        elif self._path and mode not in self._path:
            self._on_another_mode(mode, now)
        elif self._path:
            self._path = self._path[self._path.index(mode) :]
        if self.phase == "engaging" and self._path == (self._modes.rest,):
            self.phase, self.seen.current = "checking", None  # the item is to be told anew
        on_mission = self.seen.armed and mode == self._modes.mission and not self.streams
        if on_mission and self.phase in ("waiting", "starting"):
            self._begin()
        elif self._is_to_hold and self._path == (mode,):
            self._order = None
            self.seen.told.append("it holds; interrupt again to leave it")

    def _on_another_mode(self, mode: int, now: float) -> None:
        """Step aside for who set that; a last item may have a mode of its own, as PX4's return."""
        may_end = self.phase == "flying" and mode in self._modes.at_end
        if may_end and self._furthest >= self._last:
            self._over()
        else:
            self._aside_since = now if may_end else -math.inf
            self._step_aside()

    def _answered(self, order: Order, result: int, now: float) -> None:
        """Go on, or end, now that an order is answered.

        Arming that is denied is not asked for again, but for setpoints, whose mode may need what
        the checks did not ask for before: what is said about it is waited for.
        """
        order.answer = f"answers {order.command.name} with {protocol.command_result(result)}"
        accepted = result == _ACCEPTED
        order.refusals += not accepted
        match self.phase:
            case "arming" if accepted:
                self._go_on(now)
            case "arming" if self.streams and now < self.seen.begun + PATIENCE:
                order.sent = 0
            case "arming":
                order.sent, order.due = _TRIES, now + _WORDS
            case "starting" if not accepted:
                self._refused(order, now)
            case "starting" if self.streams:
                self._begin()
            case "disarming" if order.refusals == _TRIES:
                self._leave_armed(f"it {order.answer}")

    def _begin(self) -> None:
        self.phase, self._order, self._path = "flying", None, (self._flown,)
        self.seen.told.append("taking off" if self.streams else "the mission is under way")

    def _on_disarmed(self) -> None:
        match self.phase:
            case "arming" | "starting":
                self._end("refused", f"the vehicle disarmed before the mission began{self._words}")
            case "holding":
                self._end("held", "disarmed after it was asked to hold")
            case "flying" if self.streams:
                self._end("taken over", "disarmed in the middle of the flight")
            case "flying" if self._furthest < self._last:
                where = f"at item {self.seen.row}, before the end of the mission"
                self._end("taken over", f"disarmed {where}")
            case "flying" | "ending":
                self._end("finished", "landed and disarmed at the end of the mission")
            case "aside":
                self._end("taken over", "disarmed; it was not the mission that flew it last")

    def _over(self) -> None:
        """The mission is done; what is left is the landing, if there is one."""
        self.phase, self._path = "ending", ()
        if not self._lands:
            self._end("finished", f"the mission is over; the vehicle is in mode {self.seen.mode}")

    def _step_aside(self) -> None:
        if self.phase == "disarming":
            self._leave_armed(f"the pilot or a failsafe has it, in mode {self.seen.mode}")
        self.phase, self._order, self._path = "aside", None, ()
        who = "the pilot or a failsafe has the aircraft; nothing more is sent"
        self.seen.told.append(f"mode {self.seen.mode}: {who}")

    # ---- what it is told

    def _check(self, now: float) -> None:
        """Arm, if there is nothing against it, also by what it holds now and by fresh news."""
        seen, lacks, waited = self.seen, self._lacks(now), now - self.seen.begun
        self.outcome, modes = self.gate.refusal(), self._modes
        if waited >= PATIENCE:
            said = "; ".join(dict.fromkeys(seen.said)) or lacks or "it does not say why"
            self._end("refused", f"its own checks do not pass in {waited:.0f} s: {said}")
        if self.outcome is not None or waited < _LISTEN or lacks:
            return
        if seen.custom_mode == modes.mission and self.gate.is_clear:
            seen.told.append(f"mode {seen.mode}: it is armed in another, which is set first")
            self.phase, self._path = "engaging", (modes.mission, modes.rest)
            self._give(self._to_set(modes.rest), now)
        may_arm = seen.status is not None and seen.status.may_arm and seen.current is not None
        if seen.custom_mode == modes.mission or not may_arm:
            return
        asks = self.gate.read_again(now)
        self._out += asks or ()
        if asks is None and seen.is_fresh(now):
            self.gate.judge(seen, now, again=True)
            self.outcome = self.gate.refusal()
            if self.gate.is_clear:
                orders = f"arming, and starting {counted(seen.items, 'item')}"
                orders = "it is set to follow setpoints, then armed" if self.streams else orders
                seen.told.append(f"its own checks pass: {orders}")
                self._go_on(now)

    def _lacks(self, now: float) -> str:  # noqa: ARG002
        """Return what it does not know that it has to, in words."""
        return "" if self.seen.knows_place else "it does not know where it is"

    def _go_on(self, now: float) -> None:
        """Give the next of the orders that start it; after the last one it has begun."""
        if not self._left:
            self._begin()
            return
        self.phase, order = self._left.pop(0)
        mode = self.seen.custom_mode
        self._path = (mode,) if self.phase == "arming" else (mode, self._flown)
        self._give(order, now)

    def _ask_to_hold(self, now: float) -> None:
        hold = self._modes.hold
        self._path = self._path if self._path[-1:] == (hold,) else (*self._path, hold)
        self._give(self._to_set(hold), now)
        self.phase = "holding"  # last: an interrupt before asks again
        self.seen.told.append("asking the vehicle to hold; interrupt again to leave it")

    @property
    def _is_to_hold(self) -> bool:
        """Whether it was asked to hold, and is not known to do so."""
        return self.phase == "holding" and self._order is not None

    def _to_set(self, mode: int) -> Order:
        return Order(MavCommand.SET_MODE, self._family.mode_parameters(mode))

    def _give(self, order: Order, now: float) -> None:
        """Give an order, and repeat it until it is answered."""
        self._order = order
        self.seen.said.clear()
        self._repeat(now)

    def _repeat(self, now: float) -> None:
        order, unseen = self._order, self.phase == "engaging" and not self.seen.is_fresh(now)
        if order is None or now < order.due or unseen:
            return
        if order.sent == _TRIES and self.phase == "holding":
            text = f"it does not confirm that it holds, it {order.answer}: it is asked again"
            self.seen.told.append(f"{text} until then")
        if order.sent >= _TRIES and self.phase in BEFORE:
            self._refused(order, now)
            return
        again = min(order.sent, 255)
        self._out.append(CommandLong(self._peer.address, order.command, again, *order.params))
        order.sent, order.due = order.sent + 1, now + _AGAIN

    # ---- how it ends

    def _refused(self, order: Order, now: float) -> None:
        """End before the start; an aircraft that is armed, or may be, disarms first."""
        then = Ending("refused", f"the vehicle {order.answer}")
        unsure = self.phase == "arming" and not order.refusals
        if unsure or self.seen.armed or self.phase == "starting":
            self._disarm(then, now)
        else:
            self._end(then.kind, f"{then.text}{self._words}")

    @property
    def _words(self) -> str:
        """What it has said since the last order, as the end of a sentence."""
        said = dict.fromkeys(self.seen.said)
        return f". It says: {'; '.join(said)}" if said else ""

    def _disarm(self, then: Ending, now: float) -> None:
        """Have it disarm, and end with `then`."""
        self._then, self._path = then, (self.seen.custom_mode, self._flown)
        # The order first: an interrupt between finds it, not the one to arm.
        self._order = Order(MavCommand.ARM, (0.0,))
        self.phase = "disarming"
        self.seen.told.append(f"{then.text}: it is asked to disarm")
        self._repeat(now)

    def _leave_armed(self, why: str) -> None:
        """End, though it may still be armed."""
        then = self._then
        self._end(then.kind, f"{then.text}; it may still be armed: {why}{self._words}")

    def _end_as_heard(self, now: float) -> None:
        """End where what was heard says so; what may be armed is disarmed whatever that is."""
        ending = self.seen.ending
        if ending is not None and ending.kind == "changed" and self.phase in ("arming", "starting"):
            self._disarm(ending, now)
        elif self.phase != "disarming":
            self.outcome = ending
        elif ending is not None and ending.kind == "lost":
            self._leave_armed(f"nothing was heard for {PATIENCE:.0f} s")

    def _end(self, kind: Kind, text: str) -> None:
        self.outcome = self.outcome or Ending(kind, text)
