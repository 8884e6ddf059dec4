"""The mock autopilot: a vehicle without sockets or clock."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from faao_mav.autopilot import vehicle_type
from faao_mav.errors import InputError
from faao_mav.mission.command import Command
from faao_mav.mission.item import Home, Mission
from faao_mav.sim.behaviour import Behaviour, whole
from faao_mav.sim.flight import Flight, Fly
from faao_mav.sim.follower import Posture, global_position, local_reports
from faao_mav.sim.lists import ListServer, StoredLists
from faao_mav.sim.parameter_protocol import ParameterServer
from faao_mav.wire import messages, protocol
from faao_mav.wire.machine import Machine
from faao_mav.wire.messages import CommandLong, Envelope, Message, Statustext
from faao_mav.wire.protocol import Address, MavCommand, MissionType
from faao_mav.wire.wire_items import home_items, mission_of

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
"""MAV_RESULT."""

_SET_MODE, _AUTOPILOT_VERSION = 11, 148
"""The numbers of these messages."""

_CUSTOM_MODE, _AUTO = 1, 4 | 8 | 16
"""MAV_MODE_FLAG: a custom mode is set; automatic, guided and stabilised."""

_LATE = 0.05
"""Seconds by which `tick` is overdue that make a sped up flight stand still; chosen."""

# MISSION_FLOAT, MISSION_INT, COMMAND_INT, MAVLINK2, MISSION_FENCE, MISSION_RALLY
_CAPABILITIES = 1 | 4 | 8 | 8192 | 16_384 | 32_768


class MockAutopilot(Machine[None]):
    """It takes missions as ArduPilot or PX4 does, and flies them as predicted or as `fly` says.

    `aircraft` is what its heartbeats say that it is, and whose missions it stores.
    It boots for `boot` seconds, in which it refuses lists, and then knows after `place` seconds
    where it is, before which it starts no mission. Armed and set to the mission it flies
    what it holds, and disarms where a flight ends on the ground; broken off by another mode the
    mission is flown on when it is set again. It reports its position `rate` times a
    second until it is asked for another rate. Its clock runs `speedup` times as fast as the
    world's, as those of simulators do; on a mission it then stands still while `tick` is late,
    rather than jump, as theirs do. Heartbeats are `beat` of the world's seconds apart.
    `parameters` are told beside its defaults, and may be set; of the names of one it has the oldest
    that is given. It tells that its battery is at `battery` percent, -1: not known. It flies in
    a `wind`, m/s east and north.
    """

    progress = ("flying", 0, 0)

    def __init__(
        self,
        behaviour: Behaviour,
        *,
        aircraft: str = "copter",
        address: Address = Address(1, 1),  # noqa: B008
        home: Home = Home(-35.363262, 149.165237, 584.0),  # noqa: B008
        fly: Fly | None = None,
        parameters: Mapping[str, float] | None = None,
        speedup: float = 1.0,
        rate: float = 4.0,
        beat: float = 1.0,
        boot: float = 0.0,
        place: float = 0.0,
        wind: tuple[float, float] = (0.0, 0.0),
        battery: int = 100,
    ) -> None:
        super().__init__()
        self._battery = battery
        self.behaviour, self.address, self.home = behaviour, address, home
        self.vehicle = vehicle_type(behaviour.family.key, aircraft)
        self.lists = StoredLists(self.vehicle, home)
        self._tells_asked_mode = False
        known = self.vehicle.defaults() | dict(behaviour.family.setpoints.defaults)
        for failsafe in self.vehicle.failsafes:
            known |= dict(failsafe.defaults)
        known |= behaviour.parameters
        self.parameters = ParameterServer(known, parameters or {}, self.vehicle)
        self.flight = Flight(self.vehicle, self.parameters.values, home, fly, wind)
        self._server = ListServer(self.lists, behaviour, self._is_ready, self._is_flying)
        self._speedup, self._beat, self._boot, self._place = speedup, beat, boot, place
        self._period = 1 / rate / speedup if rate > 0 else math.inf
        self._booted = self._now = self._ticked = self._next_beat = self._next_report = 0.0
        self._ready_at = boot
        self._current = 0

    @property
    def armed(self) -> bool:
        """Whether the motors may turn."""
        return self.flight.armed

    @property
    def mode(self) -> int:
        """The custom mode that it is in."""
        return self.flight.mode

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        event = self._booted + self.flight.next_event / self._speedup
        ahead = self.armed and event > self._ticked  # what a tick has seen is over
        due = [self._next_beat, event if ahead else math.inf]
        if self._period < math.inf:
            due.append(self._next_report)
        if self._server.deadline is not None:
            due.append(self._server.deadline)
        return min(due)

    def start(self, now: float) -> Sequence[Message]:
        """Boot."""
        self._booted = self._now = self._next_beat = self._next_report = now
        self._ready_at = now + self._boot
        return self.tick(now)

    def reboot(self, now: float) -> None:
        """Begin anew; what is stored stays, what is under way is lost."""
        self._server.reset()
        self.flight.stop()
        self._current = 0
        self._booted, self._ready_at = now, now + self._boot

    def posture(self, now: float) -> Posture:
        """Return where the aircraft is."""
        return self.flight.aircraft.at(self._clock(now))

    def mission(self) -> Mission:
        """Return what is stored, as a mission."""
        return mission_of({part: self.lists.items(part) for part in MissionType}, self.vehicle)

    def _clock(self, now: float) -> float:
        """Return the time on its own clock, s since it booted."""
        return (now - self._booted) * self._speedup

    def _time_out(self, now: float) -> Sequence[Message]:
        late = now - (self.deadline or now)
        if self._speedup > 1 and self.flight.on_mission and late > _LATE:
            self._booted += late
        self._now = self._ticked = now
        out: list[Message] = list(self._server.tick(now))
        if self.armed:
            out += self._follow(now)
        if now >= self._next_beat:
            self._next_beat = now + self._beat
            out += [self._heartbeat(), self._mission_current(now), *self._system_status()]
            if self._tells_asked_mode:
                out.append(messages.CurrentMode(self.flight.mode, self.flight.asked_mode))
        if now >= self._next_report and self._period < math.inf:
            self._next_report = now + self._period
            out += self._place_reports(now)
        return out

    def _place_reports(self, now: float) -> list[Message]:
        """Return where it is, on Earth first; what it tells of that while it does not know."""
        posture, clock = self.posture(now), self._clock(now)
        place = global_position(posture, self.home, clock)
        if self._knows_place():
            return [place, *local_reports(posture, clock)]
        return [replace(place, lat=0, lon=0, alt=0)] if self.behaviour.tells_no_place else []

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        self._now = now
        sender, message = envelope.sender, envelope.message
        if isinstance(message, messages.Timesync):
            here = int(self._clock(now) * 1e9) + 1
            return [messages.Timesync(here, message.ts1)] if message.tc1 == 0 else ()
        if isinstance(message, messages.SetMode):
            target = Address(message.target_system, 0)
        elif isinstance(message, messages.Addressed):
            target = message.target
        else:
            return ()
        own = self.address
        # PX4 takes for its own what is sent to its mission planner.
        as_planner = Address(own.system, protocol.GROUND_STATION.component)
        if sender == own or not (own.takes(target) or as_planner.takes(target)):
            return ()
        match message:
            case CommandLong():
                return self._on_command(sender, message, now)
            case messages.SetMode(custom_mode=mode):
                return [messages.CommandAck(sender, _SET_MODE, self._set_mode(mode, now))]
            case messages.ParamRequestList() | messages.ParamRequestRead() | messages.ParamSet():
                return self.parameters.on(message)
            case messages.MissionSetCurrent(seq=seq):
                return self._set_current(seq, now)
            case messages.SetPositionTargetLocalNed():
                comes_back = self.flight.hear(message, self._clock(now))
                modes = messages.CurrentMode(self.flight.mode, self.flight.asked_mode)
                return [self._heartbeat(), modes] if comes_back else ()
        if self.behaviour.silent_at_boot and not self._is_ready():
            return ()
        return self._server.on(envelope, now)

    def _is_ready(self) -> bool:
        return self._now >= self._ready_at

    def _knows_place(self) -> bool:
        return self._now >= self._ready_at + self._place

    def _is_flying(self) -> bool:
        return self.flight.on_mission

    def _on_command(self, sender: Address, command: CommandLong, now: float) -> list[Message]:
        result, answers = ACCEPTED, list[Message]()
        match command.command:
            case MavCommand.ARM:
                result = self._arm(command.param1 >= 0.5, now)
                why = self._why_not_armed() if result == self.behaviour.not_armed else None
                if why is not None:
                    text = self.behaviour.not_armed_text.format(why)
                    answers.append(Statustext(protocol.MavSeverity.CRITICAL, text))
            case MavCommand.TAKEOFF:
                climbs = self.flight.take_off(command.param7, self._clock(now))
                result = ACCEPTED if climbs else DENIED
            case MavCommand.START if not self._knows_place():
                result = FAILED
            case MavCommand.START:
                self.flight.enter(self.flight.modes.mission, self._clock(now))
                result = self._begin(now)
            case MavCommand.SET_MODE:
                result = self._set_mode(self.behaviour.requested_mode(command), now)
            case MavCommand.SET_CURRENT:
                found = self._set_current(whole(command.param1), now)
                result = ACCEPTED if found else DENIED
                answers += found
            case MavCommand.REQUEST_MESSAGE | MavCommand.REQUEST_CAPABILITIES as asked:
                by_number = asked == MavCommand.REQUEST_MESSAGE
                kind = whole(command.param1) if by_number else _AUTOPILOT_VERSION
                answers += self._asked_for(kind)
                result = ACCEPTED if answers else UNSUPPORTED
            case MavCommand.SET_INTERVAL if command.param1 == protocol.CURRENT_MODE:
                self._tells_asked_mode = bool(self.flight.rules.loss)
            case MavCommand.SET_INTERVAL:
                period = whole(command.param2)  # microseconds; 0: the usual rate
                if command.param1 == protocol.POSITION and period > 0 and self._period < math.inf:
                    self._period = period / 1e6 / self._speedup
            case MavCommand.REBOOT:
                self.reboot(now)
            case _:
                result = UNSUPPORTED
        ack = messages.CommandAck(sender, command.command, result)
        return [ack, *answers]

    def _asked_for(self, kind: int) -> list[Message]:
        home = self.home
        place = (round(home.latitude * 1e7), round(home.longitude * 1e7))
        if kind == _AUTOPILOT_VERSION:
            return [messages.AutopilotVersion(_CAPABILITIES, 0x04_06_00_FF, self.address.system)]
        if kind == protocol.POSITION:
            return self._place_reports(self._now)[:1]
        spot = {
            protocol.HOME_POSITION: messages.HomePosition,
            protocol.LOCAL_ORIGIN: messages.GpsGlobalOrigin,
        }.get(kind)
        return [] if spot is None else [spot(*place, round(home.altitude * 1000))]

    def _arm(self, wanted: bool, now: float) -> int:
        if not wanted:
            self.flight.stop()
            return ACCEPTED
        if self._why_not_armed() is not None:
            return self.behaviour.not_armed
        if not self.armed:
            self.flight.arm(self._clock(now))
        return self._begin(now) if self.mode == self.flight.modes.mission else ACCEPTED

    def _why_not_armed(self) -> str | None:
        """Return what it says when it does not arm, None if it does."""
        if not self._is_ready():
            return "Calibrating"
        if self.mode in self.flight.modes.not_to_arm_in:
            return "Mode not armable"
        try:
            fence = self.mission().fence
        except InputError:  # peers store what they like
            return None
        outside = self.behaviour.armed_inside_only and self.flight.home_outside(fence)
        return "Vehicle breaching Polygon fence" if outside else None

    def _set_mode(self, mode: int | None, now: float) -> int:
        modes, clock = self.flight.modes, self._clock(now)
        if mode is None:
            return self.behaviour.no_mode
        if mode == modes.mission and self._problem():
            return self.behaviour.mode_denied
        if mode == modes.guided and not self.flight.accepts_guided(clock):
            return self.behaviour.mode_denied
        self.flight.enter(mode, clock)
        return self._begin(now) if mode == modes.mission else ACCEPTED

    def _problem(self) -> str:
        """Return why what is stored cannot be flown, "" if it can."""
        try:
            mission = self.mission()
        except InputError as error:  # peers store what they like
            return str(error)
        if not mission.items:
            return "no mission"
        return self.behaviour.infeasible(mission)

    def _begin(self, now: float) -> int:
        """Fly the mission, once armed and told to; not a second time."""
        if self._problem():
            return DENIED
        mission = replace(self.mission(), home=self.home)
        return ACCEPTED if self.flight.begin(mission, self._clock(now)) else DENIED

    def _follow(self, now: float) -> list[Message]:
        """Let the flight go on, and tell what becomes of it."""
        flight, clock, first = self.flight, self._clock(now), self._first_number()
        out: list[Message] = [messages.MissionItemReached(n + first) for n in flight.reached(clock)]
        before = flight.mode
        if flight.at_fence(clock) is not None:
            out.append(Statustext(protocol.MavSeverity.CRITICAL, self.behaviour.fence_text))
        flight.lose_setpoints(clock)
        current = flight.aircraft.at(clock).item + first
        if flight.on_mission and current != self._current:
            self._current = current
            rows = self.lists.items(MissionType.MISSION)
            returns = (
                rows[current : current + 1]
                and rows[current].command == Command.NAV_RETURN_TO_LAUNCH
            )
            if self.vehicle.kind in self.behaviour.returns_by_mode and returns:
                flight.mode = flight.modes.at_fence.get("return", flight.mode)
            out.append(self._mission_current(now))
        if flight.aircraft.landed(clock):
            flight.land()
            out.append(Statustext(protocol.MavSeverity.INFO, "Landed, disarming"))
        if (flight.mode, flight.armed) != (before, True):
            out.append(self._heartbeat())
        return out

    def _first_number(self) -> int:
        return home_items(self.vehicle, MissionType.MISSION)

    def _set_current(self, seq: int, now: float) -> list[Message]:
        if not 0 <= seq < len(self.lists.items(MissionType.MISSION)):
            return []
        self._current = seq
        return [self._mission_current(now)]

    def _mission_current(self, now: float) -> Message:
        total = len(self.lists.items(MissionType.MISSION)) - self._first_number()
        # MISSION_STATE: none, not started, active
        state = 1 if total == 0 else 3 if self.flight.on_mission else 2
        if self.flight.on_mission and self._clock(now) >= self.flight.aircraft.arrives:
            state = protocol.MISSION_COMPLETE
        number = self.lists.number(MissionType.MISSION) if self.behaviour.numbers_lists else 0
        return messages.MissionCurrent(self._current, max(total, 0), state, number)

    def _system_status(self) -> list[Message]:
        """Return that its checks pass, once it is ready, and how its battery is."""
        passes = protocol.PREARM_CHECK * self._is_ready()
        return [
            messages.SysStatus(passes, 12_600, self._battery),
            messages.BatteryStatus(0, 1, self._battery),
        ]

    def _heartbeat(self) -> Message:
        if not self._is_ready():
            state = protocol.MavState.CALIBRATING
        else:
            state = protocol.MavState.ACTIVE if self.armed else protocol.MavState.STANDBY
        autopilot, is_mission = (
            self.vehicle.family.mav_autopilot,
            self.mode == self.flight.modes.mission,
        )
        base_mode = _CUSTOM_MODE | _AUTO * is_mission | protocol.ARMED * self.armed
        return messages.Heartbeat(self.vehicle.mav_types[0], autopilot, base_mode, self.mode, state)
