"""The mock autopilot: a vehicle without sockets or clock."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from faao_mav.autopilot import vehicle_type
from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import Command
from faao_mav.mission.item import Home, Mission
from faao_mav.sim.behaviour import Behaviour, whole
from faao_mav.sim.flight import Flight
from faao_mav.sim.storage import ParameterServer, StoredLists
from faao_mav.wire import messages, protocol
from faao_mav.wire.machine import Machine
from faao_mav.wire.messages import CommandLong, Envelope, Message, Statustext
from faao_mav.wire.protocol import Address, MavCommand, MavSeverity, MavState, MissionType
from faao_mav.wire.wire_items import home_items, mission_of

_ACCEPTED, _DENIED, _UNSUPPORTED, _FAILED = 0, 2, 3, 4  # MAV_RESULT.

_SET_MODE = 11  # The number of SET_MODE.
_CUSTOM_MODE, _AUTO = 1, 4 | 8 | 16
"""MAV_MODE_FLAG: a custom mode is set; automatic, guided and stabilised."""

_LATE = 0.05  # Seconds by which `tick` is overdue that make a sped up flight stand still; chosen.
_CAPABILITIES = 1 | 4 | 8 | 8192 | 16_384 | 32_768
"""MISSION_FLOAT, MISSION_INT, COMMAND_INT, MAVLINK2, MISSION_FENCE and MISSION_RALLY."""

_VERSION = 0x04_06_00_FF  # That of a release, 4.6.0.


class MockAutopilot(Machine[None]):
    """It takes missions as ArduPilot or PX4 does, and flies them as predicted.

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

    def __init__(
        self,
        behaviour: Behaviour,
        *,
        aircraft: str = "copter",
        address: Address = Address(1, 1),  # noqa: B008
        home: Home = Home(-35.363262, 149.165237, 584.0),  # noqa: B008
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
        self.behaviour, self.address, self.home = behaviour, address, home
        self.vehicle = vehicle_type(behaviour.family.key, aircraft)
        known = self.vehicle.defaults() | dict(behaviour.family.setpoints.defaults)
        for failsafe in self.vehicle.failsafes:
            known |= dict(failsafe.defaults)
        known |= behaviour.parameters
        self.parameters = ParameterServer(known, parameters or {}, self.vehicle)
        self.flight = Flight(self.vehicle, self.parameters.values, home, wind)
        self.lists = StoredLists(
            self.vehicle, home, behaviour, self._is_ready, lambda: self.flight.on_mission
        )
        self._speedup, self._beat, self._boot, self._place = speedup, beat, boot, place
        self._battery, self._tells_asked_mode, self._current = battery, False, 0
        self._period = 1 / rate / speedup if rate > 0 else math.inf
        self._booted = self._now = self._next_beat = self._next_report = 0.0
        self._first = home_items(self.vehicle, MissionType.MISSION)

    @property
    def armed(self) -> bool:
        """Whether the motors may turn."""
        return self.flight.armed

    @property
    def mode(self) -> int:
        """The custom mode that it is in."""
        return self.flight.mode

    @property
    def deadline(self) -> float:
        """When `tick` is due."""
        return min(self._next_beat, self.lists.deadline, self._next_report)

    def start(self, now: float) -> Sequence[Message]:
        """Boot."""
        self._booted = self._now = self._next_beat = now
        self._next_report = now if self._period < math.inf else math.inf
        return self.tick(now)

    def reboot(self, now: float) -> None:
        """Begin anew; what is stored stays, what is under way is lost."""
        self.lists.reset()
        self.flight.stop()
        self._current, self._booted = 0, now

    def mission(self) -> Mission:
        """Return what is stored, as a mission."""
        return mission_of({part: self.lists.items(part) for part in MissionType}, self.vehicle)

    @property
    def _clock(self) -> float:
        """The time on its own clock, s since it booted."""
        return (self._now - self._booted) * self._speedup

    def _is_ready(self, more: float = 0.0) -> bool:
        return self._now >= self._booted + self._boot + more

    def _time_out(self, now: float) -> Sequence[Message]:
        late = now - self.deadline
        if self._speedup > 1 and self.flight.on_mission and late > _LATE:
            self._booted += late
        self._now = now
        out = self.lists.tick(now)
        if self.armed:
            out += self._follow()
        if now >= self._next_beat:
            self._next_beat = now + self._beat
            passes = protocol.PREARM_CHECK * self._is_ready()
            status = messages.SysStatus(passes, 12_600, self._battery)
            battery = messages.BatteryStatus(0, 1, self._battery)
            out += [self._heartbeat(), self._mission_current(), status, battery]
            out += [self._modes()] * self._tells_asked_mode
        if now >= self._next_report:
            self._next_report = now + self._period
            out += self._place_reports()
        return out

    def _modes(self) -> Message:
        return messages.CurrentMode(self.flight.mode, self.flight.asked_mode)

    def _place_reports(self) -> list[Message]:
        """Return where it is, on Earth first; what it tells of that while it does not know."""
        time, posture = int(self._clock * 1000) % 2**32, self.flight.aircraft.at(self._clock)
        (east, north, up), (v_east, v_north, v_up) = map(list, (posture.position, posture.velocity))
        frame = LocalFrame(self.home.latitude, self.home.longitude)
        latitude, longitude = map(float, frame.to_geodetic([east, north]))
        heading = math.atan2(v_east, v_north)
        place = messages.GlobalPositionInt(
            time,
            round(latitude * 1e7),
            round(longitude * 1e7),
            _fitted((self.home.altitude + up) * 1000, 32),
            _fitted(up * 1000, 32),
            _fitted(100 * v_north, 16),
            _fitted(100 * v_east, 16),
            _fitted(-100 * v_up, 16),
            round(math.degrees(heading) % 360 * 100) % 36_000,
        )
        if not self._is_ready(self._place):
            return [replace(place, lat=0, lon=0, alt=0)] if self.behaviour.tells_no_place else []
        local = messages.LocalPositionNed(time, north, east, -up, v_north, v_east, -v_up)
        return [place, local, messages.Attitude(time, heading)]

    def _follow(self) -> list[Message]:
        """Let the flight go on, and tell what becomes of it."""
        flight, clock, first = self.flight, self._clock, self._first
        before, out = flight.mode, list[Message]()
        if flight.leaves_fence(clock):
            out.append(Statustext(MavSeverity.CRITICAL, "Polygon fence breached"))
        flight.lose_setpoints(clock)
        current = flight.aircraft.at(clock).item + first
        if flight.on_mission and current != self._current:
            self._current = current
            rows, back = self.lists.items(MissionType.MISSION), flight.modes.at_fence.get("return")
            returns = rows[current:] and rows[current].command == Command.NAV_RETURN_TO_LAUNCH
            if returns and back is not None and back in flight.modes.at_end:
                flight.mode = back
            out.append(self._mission_current())
        if flight.aircraft.landed(clock):
            flight.land()
            self._rewind()
            out.append(Statustext(MavSeverity.INFO, "Landed, disarming"))
        if (flight.mode, flight.armed) != (before, True):
            out.append(self._heartbeat())
        return out

    def _mission_current(self) -> Message:
        total = len(self.lists.items(MissionType.MISSION)[self._first :])
        # MISSION_STATE: none, not started, active
        state = 1 if total == 0 else 3 if self.flight.on_mission else 2
        if self.flight.on_mission and self._clock >= self.flight.aircraft.arrives:
            state = protocol.MISSION_COMPLETE
        return messages.MissionCurrent(self._current, total, state, self.lists.number)

    def _heartbeat(self) -> Message:
        state = MavState.ACTIVE if self.armed else MavState.STANDBY
        state = state if self._is_ready() else MavState.CALIBRATING
        on_mission = self.mode == self.flight.modes.mission
        flags = _CUSTOM_MODE | _AUTO * on_mission | protocol.ARMED * self.armed
        autopilot = self.vehicle.family.mav_autopilot
        return messages.Heartbeat(self.vehicle.mav_types[0], autopilot, flags, self.mode, state)

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        self._now = now
        sender, message = envelope.sender, envelope.message
        match message:
            case messages.Timesync(tc1=0, ts1=theirs):
                return [messages.Timesync(int(self._clock * 1e9) + 1, theirs)]
            case messages.SetMode(target_system=system):
                target = Address(system, 0)
            case messages.Addressed(target=target):
                pass
            case _:
                return ()
        # PX4 takes for its own what is sent to its mission planner.
        planner = Address(self.address.system, protocol.GROUND_STATION.component)
        if sender == self.address or not (self.address.takes(target) or planner.takes(target)):
            return ()
        match message:
            case CommandLong(command=command):
                answers = list[Message]()
                result = self._obey(message, answers)
                return [messages.CommandAck(sender, command, result), *answers]
            case messages.SetMode(custom_mode=mode):
                return [messages.CommandAck(sender, _SET_MODE, self._set_mode(mode))]
            case messages.ParamRequestList() | messages.ParamRequestRead() | messages.ParamSet():
                return self.parameters.on(message)
            case messages.SetPositionTargetLocalNed():
                comes_back = self.flight.hear(message, self._clock)
                return [self._heartbeat(), self._modes()] if comes_back else ()
            case messages.ListMessage() if self._is_ready() or not self.behaviour.silent_at_boot:
                return self.lists.on(sender, message, now)
        return ()

    def _obey(self, command: CommandLong, answers: list[Message]) -> int:
        """Do what `command` asks for, add what it says to `answers`, and return its MAV_RESULT."""
        match command.command:
            case MavCommand.ARM:
                result = self._arm(command.param1 >= 0.5)
                if result == self.behaviour.denied and (why := self._why_not_armed()):
                    answers.append(Statustext(MavSeverity.CRITICAL, f"Arm: {why}"))
                return result
            case MavCommand.TAKEOFF:
                climbs = self.flight.take_off(command.param7, self._clock)
                return _ACCEPTED if climbs else _DENIED
            case MavCommand.START:
                if not self._is_ready(self._place):
                    return _FAILED
                self.flight.enter(self.flight.modes.mission, self._clock)
                return self._begin()
            case MavCommand.SET_MODE:
                flags, main, sub = map(whole, (command.param1, command.param2, command.param3))
                custom = flags > 0 and flags & _CUSTOM_MODE
                mode = self.behaviour.requested_mode(main, sub) if custom else None
                return self.behaviour.no_mode if mode is None else self._set_mode(mode)
            case MavCommand.REQUEST_MESSAGE:
                answers += self._asked_for(whole(command.param1))
                return _ACCEPTED if answers else _UNSUPPORTED
            case MavCommand.SET_INTERVAL if command.param1 == protocol.CURRENT_MODE:
                self._tells_asked_mode = bool(self.flight.rules.loss)
            case MavCommand.SET_INTERVAL:
                period = whole(command.param2)  # microseconds; 0: the usual rate
                if command.param1 == protocol.POSITION and period > 0 and self._period < math.inf:
                    self._period = period / 1e6 / self._speedup
            case MavCommand.REBOOT:
                self.reboot(self._now)
            case _:
                return _UNSUPPORTED
        return _ACCEPTED

    def _asked_for(self, kind: int) -> list[Message]:
        home = self.home
        spot = round(home.latitude * 1e7), round(home.longitude * 1e7), round(home.altitude * 1000)
        match kind:
            case protocol.AUTOPILOT_VERSION:
                return [messages.AutopilotVersion(_CAPABILITIES, _VERSION, self.address.system)]
            case protocol.POSITION:
                return self._place_reports()[:1]
            case protocol.HOME_POSITION:
                return [messages.HomePosition(*spot)]
            case protocol.LOCAL_ORIGIN:
                return [messages.GpsGlobalOrigin(*spot)]
        return []

    def _arm(self, wanted: bool) -> int:
        if not wanted:
            self.flight.stop()
            self._rewind()
            return _ACCEPTED
        if self._why_not_armed():
            return self.behaviour.denied
        if not self.armed:
            self.flight.arm(self._clock)
        return self._begin() if self.mode == self.flight.modes.mission else _ACCEPTED

    def _rewind(self) -> None:
        """Go back to the first item, disarmed; planes do in another mode than the mission's."""
        away = self.vehicle.hovers or self.mode != self.flight.modes.mission
        if self.behaviour.rewinds and away and not self.armed:
            self._current = 0

    def _why_not_armed(self) -> str:
        """Return what it says when it does not arm, "" if it does."""
        if not self._is_ready():
            return "Calibrating"
        modes, options = self.flight.modes, self.parameters.values.get("AUTO_OPTIONS", 0)
        arms = self.mode == modes.mission and options % 2 >= 1
        if self.mode in modes.not_to_arm_in and not arms:
            return "Mode not armable"
        with suppress(InputError):  # peers store what they like
            fence = self.mission().fence
            if self.behaviour.armed_inside_only and self.flight.is_outside(fence, np.zeros(3)):
                return "Vehicle breaching Polygon fence"
        return ""

    def _set_mode(self, mode: int) -> int:
        modes, clock, before = self.flight.modes, self._clock, self.mode
        if mode == modes.mission and self._flyable() is None:
            return self.behaviour.denied
        if mode == modes.guided and not self.flight.accepts_guided(clock):
            return self.behaviour.denied
        self.flight.enter(mode, clock)
        if before == modes.mission:
            self._rewind()
        return self._begin() if mode == modes.mission else _ACCEPTED

    def _flyable(self) -> Mission | None:
        """Return what is stored, None if it cannot be flown: peers store what they like."""
        with suppress(InputError):
            mission = self.mission()
            if mission.items and not self.behaviour.infeasible(mission):
                return replace(mission, home=self.home)
        return None

    def _begin(self) -> int:
        """Fly the mission, once armed and told to; not a second time."""
        mission = self._flyable()
        begun = mission is not None and self.flight.begin(mission, self._clock)
        return _ACCEPTED if begun else _DENIED


def _fitted(value: float, bits: int) -> int:
    """Return what a field of so many bits holds: 300 m/s and more are cut."""
    most = (1 << bits - 1) - 1
    return round(min(max(value, -most), most))
