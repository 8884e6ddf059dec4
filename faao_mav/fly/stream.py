"""Flying a plan by setpoints: the trajectory itself, not way points along it."""

import math
from collections import deque
from statistics import median

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.fly.itinerary import LEVEL, Itinerary, Setpoint, at_rest
from faao_mav.fly.preflight import Clearance
from faao_mav.fly.telemetry import PATIENCE
from faao_mav.fly.watch import Order, Watch
from faao_mav.wire import messages
from faao_mav.wire.messages import Message
from faao_mav.wire.protocol import CURRENT_MODE, LOCAL_ORIGIN, MavCommand

_OFF_GROUND, _SLOW_CLIMB = 0.3, 0.5
"""Metres above home from which on a take-off is under way, though its answer is lost; and the least
speed of that, m/s. Chosen: a third of the defaults."""

_MODE_AGAIN, _TOLD_BY = 0.5, 3.0
"""Seconds between two messages about the mode that was asked for last; and seconds without one
after which it counts as the pilot who changed the mode. Chosen."""

_EARLY, _OLD = 0.8, 1.0
"""The share of a period after which the next setpoint may go, for they come irregularly; and from
how many seconds of the world on a position is too old to be answered by one: a link may have held
it back. Chosen."""

_STREAMED = 1.5
"""By how many times as long as the vehicle wants setpoints come before it is asked to follow them.
Chosen."""

_FAILSAFE = "it is in its failsafe, until setpoints come again"

_LOCAL_NED, _NO_YAW = 1, 1 << 10 | 1 << 11
"""MAV_FRAME_LOCAL_NED; and of POSITION_TARGET_TYPEMASK: yaw and yaw rate are ignored, all else
counts."""


_KEPT, _LONGEST_TRIP, _ANOTHER_CLOCK = 9, 1.0, 60.0
"""How many round trips on the link are kept, one each half second, whose median counts; the most
that counts, s; and from how many seconds of the world on a time is one of another clock than the
answers'. Chosen."""


class OwnClock:
    """What the answers to TIMESYNC tell; before the second one a round trip takes no time.

    Only those to own questions count: vehicles tell everybody what they answer to anybody.
    """

    def __init__(self) -> None:
        self._asked = deque[int](maxlen=_KEPT)
        self._trips = deque[float](maxlen=_KEPT)
        self._read = deque[tuple[float, float]](maxlen=_KEPT)
        """When we were in the middle of a short trip, and what the vehicle's clock read, s."""

    def ask(self, now: float) -> messages.Timesync:
        """Return the question, with the time `now` in it, which the answer repeats."""
        self._asked.append(int(now * 1e9))
        return messages.Timesync(0, self._asked[-1])

    def hear(self, answer: messages.Timesync, now: float) -> None:
        """Take note of an answer."""
        asked = answer.ts1 / 1e9
        if answer.tc1 and answer.ts1 in self._asked:
            self._trips.append(now - asked)
            if now - asked <= _LONGEST_TRIP:
                self._read.append(((asked + now) / 2, answer.tc1 / 1e9))

    @property
    def speed(self) -> float:
        """How many seconds of the vehicle's clock a second of the world's has."""
        if len(self._read) < 2:
            return 1.0
        (begin, first), (end, last) = self._read[0], self._read[-1]
        return max((last - first) / max(end - begin, 1e-9), 1e-3)

    @property
    def lead(self) -> float:
        """How long a round trip takes, s of the vehicle's clock."""
        if len(self._trips) < 2:
            return 0.0
        return min(self.speed * median(self._trips), _LONGEST_TRIP)

    def age(self, t: float, now: float) -> float:
        """Return how long ago, s of the world, the vehicle's clock read `t`, s; 0: not known."""
        if len(self._read) < 2:
            return 0.0
        middle, there = self._read[-1]
        age = now - middle + (there - t) / self.speed
        return age if 0 < age < _ANOTHER_CLOCK else 0.0


class Stream(Watch):
    """A watch that arms the vehicle of `gate`, and flies the solution of its flight by setpoints.

    `rate` times a second of the vehicle's own clock, whenever it tells where it is, it is told
    where to be: see `Itinerary`, of which `flight` is one; in the end what `mission.on_finish`
    says. Nothing is sent while nothing is heard of it, for a position that is old or doubted, nor
    what does not pass the `Gate`. An aircraft that cannot be led on is asked to hold. A mode that
    was not asked for ends the setpoints for good, but for a failsafe in which the vehicle still
    wants them, as PX4's CURRENT_MODE tells.

    Raises `InputError` for a vehicle that is not flown by setpoints, and what `Itinerary` raises.
    """

    streams = True

    def __init__(self, gate: Clearance, *, rate: float = 10.0) -> None:
        solution = gate.flight.solution
        assert solution is not None
        plan, finish = solution.plan, solution.plan.mission.on_finish
        super().__init__(gate, arm=True, lands=finish != "hover", rate=rate)
        if self._modes.guided is None:
            raise InputError("--stream: only copters fly by setpoints")
        self._flown, self._rules = self._modes.guided, self._family.setpoints
        self._height, self._top = plan.flight.altitude, plan.max_ground_speed
        self._left = [("engaging", self._to_set(self._flown)), self._left[0]]
        self._by_setpoints = self._rules.takes_off_by_setpoints
        if not self._by_setpoints:
            climb = Order(MavCommand.TAKEOFF, (*[0.0] * 6, self._height))
            self._left.append(("starting", climb))
        after = self._modes.at_fence
        self._finish = after["return" if finish == "rtl" else "land" if self._lands else "hold"]
        self._period = 1 / rate
        self._ahead = 0.0 if self._rules.carries_on else self._period / 2
        tell = self.seen.told.append
        self.flight = Itinerary(solution, tell, takes_off=not self._by_setpoints)
        self._clock, self._plans = OwnClock(), plan.origin.frame
        self._origin: messages.GpsGlobalOrigin | None = None
        """Where its own frame has its origin, None until it tells."""
        self._home: int | None = None
        """How high above the sea, mm, home was at the departure: it may be set anew in flight."""
        self._home_told = False
        self._unsure_since: float | None = None
        """Since when it is not known who flies it: then nothing that moves it is sent."""
        self._first_sent, self._last_sent, self._sent_by = math.inf, -math.inf, math.inf
        if self._rules.loss:
            self.seen.ask_for(CURRENT_MODE, _MODE_AGAIN)

    def _hear(self, message: Message, now: float) -> None:
        in_flight = self.phase in ("flying", "ending", "holding")
        # For so many of the world's seconds it keeps its mode without setpoints.
        name, values = self._rules.timeout, self.gate.held.reading.values
        kept = values.get(name, self._rules.defaults[name]) / max(self._clock.speed, 1.0)
        if in_flight and self.seen.silence > kept:
            self._unsure_since, self.seen.wanted = now, None  # it may be in another mode since
        super()._hear(message, now)
        match message:
            case messages.GpsGlobalOrigin():
                self._origin = message
            case messages.Timesync():
                self._clock.hear(message, now)
            case messages.CurrentMode(custom_mode=mode) if in_flight:
                self._on_mode(mode, now)
            case messages.GlobalPositionInt() if message is self.seen.position:
                self._on_position(message, now)

    def _look(self, now: float) -> None:
        super()._look(now)
        if self.outcome is not None or self.phase in ("holding", "aside"):
            return
        if self.phase == "flying" and now >= self._sent_by:
            self._give_up("for too long no setpoint could be sent", now)
            return
        if self.phase == "checking" and self._origin is None:
            ask = (MavCommand.REQUEST_MESSAGE, 0, float(LOCAL_ORIGIN))
            self._out.append(messages.CommandLong(self._peer.address, *ask))
        self._out.append(self._clock.ask(now))

    def _lacks(self, now: float) -> str:
        if self._origin is None or not self.seen.fixes:
            return super()._lacks(now) or "it does not tell where its own frame begins"
        age = self._clock.age(self.seen.fixes[-1].t, now)
        late = f"its positions come {age:.0f} s late, by the clock of its TIMESYNC"
        return late if age > _OLD else super()._lacks(now)

    # ---- who flies it

    def _begin(self) -> None:
        super()._begin()
        position = self.seen.position
        assert position is not None
        self._home = position.alt - position.relative_alt
        climb = 0.0 if self._by_setpoints else self._height / _SLOW_CLIMB
        self._sent_by = self.seen.heard_at + PATIENCE + climb

    def _on_mode(self, mode: int, now: float) -> None:
        if mode in self._path:
            self._unsure_since = None
        super()._on_mode(mode, now)
        if self.phase == "engaging" and mode == self._flown:
            self._go_on(now)
        elif self.phase == "ending" and mode == self._finish:
            self._order = None
            if not self._lands:
                self._over()

    def _on_another_mode(self, mode: int, now: float) -> None:
        """Step aside for somebody else; its failsafe for lost setpoints is told.

        In the mode of its failsafe it is that, if the mode that was asked for last is still the one
        for setpoints; while that is not known, nor is who flies it.
        """
        led = self.phase in ("flying", "ending") or (self.phase == "holding" and self._order)
        wanted, since = self.seen.wanted, self._unsure_since
        by_itself = led and self._rules.comes_back_from(mode, self.gate.held.reading.values)
        if by_itself and wanted is None and (since is None or now <= since + _TOLD_BY):
            self._unsure_since = since or now
            return
        self._unsure_since = None
        if by_itself and wanted is not None and wanted.intended_custom_mode == self._flown:
            if self.seen.told[-1] != _FAILSAFE:
                self.seen.told.append(_FAILSAFE)
        elif self.seen.armed or self.phase != "ending":
            self._step_aside()

    def _repeat(self, now: float) -> None:
        """Give the order; that to follow setpoints once these have come for long enough."""
        waits = self.phase == "engaging" and self._by_setpoints
        streamed = self._last_sent >= self._first_sent + _STREAMED * self._rules.streamed
        if self._unsure_since is None and (streamed or not waits):
            super()._repeat(now)

    def _give_up(self, why: str, now: float) -> None:
        """End the setpoints of an aircraft that cannot be led on: it is to hold."""
        self.seen.told.append(f"setpoints end: {why}")
        if self.seen.custom_mode == self._flown:
            self._ask_to_hold(now)
        else:
            self._step_aside()

    # ---- where it is to be

    def _on_position(self, position: messages.GlobalPositionInt, now: float) -> None:
        home_now = position.alt - position.relative_alt
        home = home_now if self._home is None else self._home
        t, level = position.time_boot_ms / 1000, (position.lat / 1e7, position.lon / 1e7)
        place = np.append(self._plans.to_local(*level), (position.alt - home) / 1000)
        velocity = np.array([position.vy, position.vx, -position.vz]) / 100
        if self.outcome is not None or self._clock.age(t, now) > _OLD:
            return
        if self.phase == "starting" and place[2] > _OFF_GROUND:
            self._begin()
        under_way, gate = self.phase in ("flying", "ending"), self.flight.gate
        if under_way and not gate.believes(t, place, velocity):
            if gate.has_lost_it:
                self._give_up("where it is, is not known", now)
            return
        setpoint = self._setpoint(t, place, velocity)
        if under_way and self.flight.trouble is not None:
            self._give_up(self.flight.trouble, now)
            return
        risen = (home_now - home) / 1000
        if abs(risen) > LEVEL and not self._home_told:
            self._home_told = True
            what = f"home is {risen:+.0f} m higher now"
            self.seen.told.append(f"{what}: setpoints keep to that of the departure")
        over = self.flight.part == "over" and self.seen.custom_mode == self._flown
        if self.phase == "flying" and over:
            self._path = (self._flown, self._finish)
            self._give(self._to_set(self._finish), now)
            self.phase = "ending"
        if self.phase == "engaging":
            self._repeat(now)
        if setpoint is not None and t >= self._last_sent + _EARLY * self._period:
            self._last_sent, self._sent_by = t, now + PATIENCE
            self._first_sent = min(self._first_sent, t)
            self._out.append(self._told(setpoint, position.time_boot_ms, home))

    def _told(self, setpoint: Setpoint, time: int, home: int) -> Message:
        """Return `setpoint` in the vehicle's frame, at `time`, ms; `home` is mm above the sea."""
        assert self._origin is not None
        own = self._family.local_frame(self._origin.latitude / 1e7, self._origin.longitude / 1e7)
        p, v, a = setpoint
        east, north = own.to_local(*self._plans.to_geodetic(p[:2]))
        up = p[2] + (home - self._origin.altitude) / 1000
        values = (north, east, -up, v[1], v[0], -v[2], a[1], a[0], -a[2])
        return messages.SetPositionTargetLocalNed(
            self._peer.address, time, _LOCAL_NED, _NO_YAW, *map(float, values)
        )

    def _setpoint(self, t: float, place: Real, velocity: Real) -> Setpoint | None:
        """Return where the aircraft is to be at `t`; None while nothing is to be sent."""
        asked = self.phase == "ending" and self._order is not None
        if self.phase == "flying" or (asked and self.seen.custom_mode == self._flown):
            if self._unsure_since is not None:
                return None
            lead = self._ahead + self._clock.lead
            speed = max(float(np.linalg.norm(velocity)), self._top)
            by_then = place + lead * velocity * (self._top / speed)
            setpoint = self.flight.setpoint(t + lead, by_then, velocity)
            self.relay_start = self.flight.relay_start
            return setpoint
        if self._by_setpoints and self.phase in ("engaging", "arming"):
            return at_rest(place)
        return None
