"""Flying a plan by setpoints: the trajectory itself, not way points along it."""

from collections.abc import Mapping, Sequence

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.fly.belief import Belief
from faao_mav.fly.course import Setpoint
from faao_mav.fly.gate import Gate
from faao_mav.fly.itinerary import Itinerary
from faao_mav.fly.own_frame import OwnFrame
from faao_mav.fly.readiness import Readiness
from faao_mav.fly.round_trips import RoundTrips
from faao_mav.fly.watch import Watch
from faao_mav.fly.who_flies import WhoFlies
from faao_mav.optimizer.solution import Solution
from faao_mav.validate.lean import beyond_lean
from faao_mav.wire.messages import (
    CommandLong,
    CurrentMode,
    Envelope,
    GlobalPositionInt,
    GpsGlobalOrigin,
    Message,
    MissionCurrent,
    Timesync,
)
from faao_mav.wire.protocol import CURRENT_MODE, LOCAL_ORIGIN, MavCommand
from faao_mav.wire.transfer.exchange import Peer

_STREAMED = 1.5
"""By how many times as long as the vehicle wants setpoints come before it is asked to follow them.
Chosen."""

_ARM_AGAIN = 2.0
"""Seconds after which it is asked to arm again that refused; chosen."""

_OFF_GROUND = 0.3
"""Metres above home from which on a take-off is under way, though its answer is lost; chosen."""

_MODE_AGAIN = 0.5
"""Seconds between two messages about the mode that was asked for last; chosen."""

_EARLY = 0.8
"""The share of a period after which the next setpoint may go: they come irregularly; chosen."""

_OLD, _ALWAYS_OLD = 1.0, 10.0
"""From so many seconds of the world on a position is too old to be answered by a setpoint: a link
may have held it back; and seconds after which nothing is started where all of them are. Chosen."""

_SLOW_CLIMB = 0.5
"""The least speed, m/s, at which it has to take off by itself; chosen: a third of the defaults."""

_FAILSAFE = "it is in its failsafe, until setpoints come again"

_PARTS = {
    "out": "on the way to flight.start",
    "relay": "the relay flight begins",
    "back": "the relay flight is over",
    "over": "setpoints end",
}


class Stream(Watch):
    """A watch that arms the vehicle of `peer`, and flies `solution` by setpoints.

    `rate` times a second of the vehicle's own clock, whenever it tells where it is, it is told
    where to be: see `Itinerary`, of which `flight` is one; in the end what `mission.on_finish`
    says. While nothing is heard of it nothing is sent, and it does what its parameters say. A mode
    that was not asked for ends the setpoints for good, but for a failsafe in which the vehicle
    still wants them, as PX4's CURRENT_MODE tells.

    No setpoint is sent that does not pass the `Gate`, nor for a position that is old, or doubted.
    An aircraft that cannot be led on is asked to hold.

    Raises `InputError` for a vehicle that is not flown by setpoints, and what `Itinerary` raises.
    """

    streams = True
    _start_command = MavCommand.TAKEOFF

    def __init__(
        self,
        peer: Peer,
        solution: Solution,
        readiness: Readiness,
        *,
        rate: float = 10.0,
        patience: float = 60.0,
    ) -> None:
        plan = solution.plan
        finish = plan.mission.on_finish
        lands = finish != "hover"
        super().__init__(
            peer,
            (),
            arm=True,
            lands=lands,
            patience=patience,
            rate=rate,
            readiness=readiness,
        )
        if self._modes.guided is None or peer.vehicle is None:
            raise InputError("--stream: only copters fly by setpoints")
        self._family, self._guided = peer.vehicle.family, self._modes.guided
        self._rules = self._family.setpoints
        after = self._modes.at_fence
        self._finish = after["return" if finish == "rtl" else "land" if lands else "hold"]
        self._solution = solution
        self._height, self._top = plan.flight.altitude, plan.max_ground_speed
        self._period = 1 / rate
        self._held = 0.0 if self._rules.carries_on else self._period / 2
        self._round_trips = RoundTrips()
        takes_off = not self._rules.takes_off_by_setpoints
        self.flight = Itinerary(solution, Gate(plan), takes_off=takes_off)
        self._belief = Belief(self._top)
        self._frame = OwnFrame(self._family, plan.origin)
        self._who_flies = WhoFlies(self._rules, self._guided, self.seen)
        self._last_heard = float("inf")
        if self._rules.loss:
            self.seen.ask_for(CURRENT_MODE, _MODE_AGAIN)
        self._first_sent, self._last_sent = float("inf"), float("-inf")
        self._sent_by = float("inf")

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        if envelope.sender == self._peer.address:
            under_way = self.phase in ("flying", "ending", "holding")
            if under_way and now - self._last_heard > self._without_setpoints:
                self._who_flies.forget(now)
            self._last_heard = now
        out = super()._receive(envelope, now)
        if self.outcome is not None or envelope.sender != self._peer.address:
            return out
        match envelope.message:
            case GpsGlobalOrigin() as origin:
                self._frame.origin = origin
            case Timesync() as answer:
                self._round_trips.hear(answer, now)
            case CurrentMode(custom_mode=mode) if self.phase in ("flying", "ending", "holding"):
                return [*out, *self._on_mode(mode, now)]
            case GlobalPositionInt() as position:
                return [*out, *self._on_position(position, now)]
        return out

    def _time_out(self, now: float) -> Sequence[Message]:
        out = super()._time_out(now)
        if self.outcome is not None or self.phase in ("holding", "aside"):
            return out
        if self.phase == "flying" and now >= self._sent_by:
            return [*out, *self._give_up("for too long no setpoint could be sent", now)]
        return [*out, self._round_trips.ask(now)]

    # ---- before the flight

    def _check(self, now: float) -> Sequence[Message]:
        out, target = list(super()._check(now)), self._peer.address
        if self._frame.origin is None:
            ask = (MavCommand.REQUEST_MESSAGE, 0, float(LOCAL_ORIGIN))
            out.append(CommandLong(target, *ask))
        return out

    def _set_out(self, now: float) -> Sequence[Message]:
        position = self.seen.position
        if position is None or self._frame.origin is None:
            return ()
        age = self._round_trips.age(position.time_boot_ms / 1000, now)
        if age > _OLD:
            if now >= self._begun + _ALWAYS_OLD:
                text = f"its positions come {age:.0f} s late, by the clock that TIMESYNC tells"
                self._end("refused", f"nothing was started: {text}")
            return ()
        lean = beyond_lean(self._solution, self._solution.plan.aircraft)
        if lean is not None:
            self.seen.told.append(lean)
        self.seen.told.append("its own checks pass: it is set to follow setpoints, then armed")
        self.phase = "engaging"
        if self._rules.takes_off_by_setpoints:
            return ()  # setpoints come first
        return self._say(lambda: self._mode(self._guided), now)

    def _starting(self) -> Message:
        again = max(0, self._sent - 1)
        return CommandLong(self._peer.address, self._start_command, again, param7=self._height)

    # ---- what the vehicle does

    def _on_current(self, current: MissionCurrent, now: float) -> None:
        """It has a mission, which is not what is flown."""

    def _on_mode(self, mode: int, now: float) -> Sequence[Message]:
        match self.phase:
            case "engaging" if mode == self._guided:
                self.phase = "arming"
                return self._say(lambda: self._arming(True), now)
            case "engaging" if mode != self._mode_before:
                self._step_aside()
            case "arming" | "starting" if mode != self._guided:
                self._step_aside()
            case "ending" if mode == self._finish:
                self._command = None
                if not self._lands:
                    self._over()
            case "holding" if mode == self._modes.hold or self._command is None:
                return super()._on_mode(mode, now)
            case "flying" | "holding":
                self._see_who_flies(mode, now)
            case "ending" if self._armed:
                self._see_who_flies(mode, now)
        return ()

    def _see_who_flies(self, mode: int, now: float) -> None:
        """Step aside for somebody else; its failsafe for lost setpoints is told."""
        flier = self._who_flies.see(mode, self._values, now)
        if flier == "others":
            self._step_aside()
        elif flier == "failsafe" and self.seen.told[-1] != _FAILSAFE:
            self.seen.told.append(_FAILSAFE)

    def _repeat(self, now: float) -> Sequence[Message]:
        return () if self._who_flies.unsure else super()._repeat(now)

    def _denied(self, command: int, result: int, now: float) -> Sequence[Message]:
        if self.phase == "arming" and now < self._begun + self._patience:
            # In this mode it may need what its checks did not ask for before, a position above all.
            self._sent, self._next_try = 0, now + _ARM_AGAIN
            return ()
        return super()._denied(command, result, now)

    def _accepted(self, now: float) -> Sequence[Message]:
        if self.phase == "arming" and not self._rules.takes_off_by_setpoints:
            return super()._accepted(now)
        self._fly(now)
        return ()

    def _on_disarmed(self) -> Sequence[Message]:
        if self.phase == "flying":
            self._end("taken over", "disarmed in the middle of the flight")
            return ()
        return super()._on_disarmed()

    def _fly(self, now: float) -> None:
        self.phase, self._command = "flying", None
        self.seen.told.append("taking off")
        assert self.seen.position is not None
        self._frame.depart(self.seen.position)
        climb = 0.0 if self._rules.takes_off_by_setpoints else self._height / _SLOW_CLIMB
        self._sent_by = now + self._patience + climb

    def _give_up(self, why: str, now: float) -> Sequence[Message]:
        """End the setpoints of an aircraft that cannot be led on: it is to hold."""
        self.seen.told.append(f"setpoints end: {why}")
        if self._is_guided:
            return self._ask_to_hold(now)
        self._step_aside()
        return ()

    # ---- where it is to be

    def _on_position(self, position: GlobalPositionInt, now: float) -> Sequence[Message]:
        t, place = position.time_boot_ms / 1000, self._frame.place(position)
        velocity = np.array([position.vy, position.vx, -position.vz]) / 100
        if position is not self.seen.position or self._round_trips.age(t, now) > _OLD:
            return ()
        if self.phase == "starting" and place[2] > _OFF_GROUND:
            self._fly(now)
        if self.phase in ("flying", "ending") and not self._belief.holds(t, place, velocity):
            self._tell(self._belief.told)
            lost = self._belief.is_lost(t)
            return self._give_up("where it is, is not known", now) if lost else ()
        setpoint, out = self._setpoint(t, place, velocity), list[Message]()
        self._tell(self._belief.told)
        self._tell(self.flight.told)
        if self.flight.trouble is not None and self.phase in ("flying", "ending"):
            return self._give_up(self.flight.trouble, now)
        if (news := self._frame.news(position)) is not None:
            self.seen.told.append(news)
        if self.phase == "flying" and self.flight.part == "over" and self._is_guided:
            self.phase = "ending"
            out += self._say(lambda: self._mode(self._finish), now)
        if self.phase == "engaging" and self._command is None and self._streamed(t):
            out += self._say(lambda: self._mode(self._guided), now)
        if setpoint is not None and t >= self._last_sent + _EARLY * self._period:
            self._last_sent, self._sent_by = t, now + self._patience
            self._first_sent = min(self._first_sent, t)
            out.append(self._frame.message(setpoint, position, self._peer.address))
        return out

    @property
    def _values(self) -> Mapping[str, float]:
        """The vehicle's parameters."""
        return {} if self._ready is None else self._ready.values

    @property
    def _without_setpoints(self) -> float:
        """For how many of the world's seconds it keeps its mode without setpoints."""
        kept = {**self._rules.defaults, **self._values}[self._rules.timeout]
        return kept / max(self._round_trips.clock_speed, 1.0)

    @property
    def _is_guided(self) -> bool:
        """Whether the mode is that for setpoints, as far as is known."""
        return self.seen.heartbeat is None or self.seen.heartbeat.custom_mode == self._guided

    def _streamed(self, t: float) -> bool:
        """Tell whether the vehicle has had setpoints for long enough."""
        return t >= self._first_sent + _STREAMED * self._rules.streamed

    def _tell(self, told: list[str]) -> None:
        self.seen.told += told
        told.clear()

    def _setpoint(self, t: float, place: Real, velocity: Real) -> Setpoint | None:
        """Return where the aircraft is to be at `t`; None while nothing is to be sent."""
        asked = self.phase == "ending" and self._command is not None
        flying = self.phase == "flying" or (asked and self._is_guided)
        if flying and not self._who_flies.unsure:
            part = self.flight.part
            lead = self._held + self._round_trips.lasting
            speed = max(float(np.linalg.norm(velocity)), self._top)
            by_then = place + lead * velocity * (self._top / speed)
            setpoint = self.flight.setpoint(t + lead, by_then, velocity)
            if self.flight.part != part:
                self.seen.told.append(_PARTS[self.flight.part])
                self.relay_start = self.flight.relay_start
            return setpoint
        if self._rules.takes_off_by_setpoints and self.phase in ("engaging", "arming"):
            return Setpoint(place, np.zeros(3), np.zeros(3))
        return None
