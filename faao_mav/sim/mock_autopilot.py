"""The mock autopilot: a vehicle without sockets or clock."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from faao_mav.autopilot import Track, Vehicle, vehicle_type
from faao_mav.errors import InputError
from faao_mav.mission.command import Command
from faao_mav.mission.item import Home, Mission
from faao_mav.sim.firmware import Behaviour, StoredLists, whole
from faao_mav.sim.flight import MockFlight, Posture, telemetry
from faao_mav.sim.from_the_air import taken_up
from faao_mav.sim.guided import Guided
from faao_mav.sim.parameter_protocol import ParameterServer
from faao_mav.sim.turn_back import home_outside, kept_inside
from faao_mav.wire.machine import Machine
from faao_mav.wire.messages import (
    Addressed,
    AutopilotVersion,
    BatteryStatus,
    CommandAck,
    CommandLong,
    CurrentMode,
    Envelope,
    GpsGlobalOrigin,
    Heartbeat,
    HomePosition,
    Message,
    MissionCurrent,
    MissionSetCurrent,
    ParamRequestList,
    ParamRequestRead,
    ParamSet,
    SetMode,
    SetPositionTargetLocalNed,
    Statustext,
    SysStatus,
    Timesync,
)
from faao_mav.wire.protocol import (
    ARMED,
    CURRENT_MODE,
    GROUND_STATION,
    HOME_POSITION,
    LOCAL_ORIGIN,
    MISSION_COMPLETE,
    POSITION,
    PREARM_CHECK,
    Address,
    MavCommand,
    MavSeverity,
    MavState,
    MissionType,
)
from faao_mav.wire.wire_items import home_items, mission_of

Fly: TypeAlias = Callable[[Mission, Vehicle], Track]
"""How a vehicle with the parameters that it has flies a mission."""

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
"""MAV_RESULT."""


_AUTOPILOT_VERSION = 148
"""The number of the message AUTOPILOT_VERSION."""

_CUSTOM_MODE, _AUTO = 1, 4 | 8 | 16
"""MAV_MODE_FLAG: a custom mode is set; automatic, guided and stabilised."""

_LATE = 0.05
"""Seconds by which `tick` is overdue that make a sped up flight stand still; chosen."""

# MISSION_FLOAT, MISSION_INT, COMMAND_INT, MAVLINK2, MISSION_FENCE, MISSION_RALLY
_CAPABILITIES = 1 | 4 | 8 | 8192 | 16_384 | 32_768
_AT_HOME = Posture(np.zeros(3), np.zeros(3), 0)


class MockAutopilot(Machine[None]):
    """It takes missions as ArduPilot or PX4 does, and flies them along `fly`'s track.

    `aircraft` is what its heartbeats say that it is, and whose missions it stores.
    It boots for `boot` seconds, in which it refuses lists, and then knows after `place` seconds
    where it is, before which it starts no mission. Armed and set to the mission it flies
    what it holds, and disarms where the flight ends on the ground; in another mode it stays where
    it is, and flies on when set to the mission again. It reports its position `rate` times a
    second until it is asked for another rate. Its clock runs `speedup` times as fast as the
    world's, as those of simulators do; on a mission it then stands still while `tick` is late,
    rather than jump, as theirs do. Heartbeats are `beat` of the world's seconds apart.
    `parameters` are told beside its defaults, and may be set; of the names of one it has the oldest
    that is given. It tells that its battery is at `battery` percent, -1: not known. In GUIDED
    and Offboard it follows setpoints, in a `wind`, m/s east and north: see `Guided`. `armed`
    tells whether the motors may turn.
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
        self._modes = self.vehicle.modes
        self._mode = self._wanted = self._modes.rest
        self.lists = StoredLists(self.vehicle, home)
        rules = behaviour.family.setpoints
        self._comes_back = bool(rules.loss)
        self._tells_wanted = False  # only once it is asked for CURRENT_MODE
        known = self.vehicle.defaults() | dict(rules.defaults)
        for failsafe in self.vehicle.failsafes:
            known |= dict(failsafe.defaults)
        known |= dict(behaviour.firmware.parameters)
        self.parameters = ParameterServer(known, parameters or {}, self.vehicle)
        self._firmware = behaviour.firmware(self.lists, behaviour, self._is_ready, self._is_flying)
        self._fly, self._speedup = fly, speedup
        self._period = 1 / rate / speedup if rate > 0 else None
        self._beat = beat
        self._boot, self._place = boot, place
        self._booted = self._ready_at = self._now = 0.0
        self._next_beat = self._next_report = 0.0
        self.armed = False
        self._current = 0
        self._flight: MockFlight | None = None
        self._rest = _AT_HOME
        self._broken_off: tuple[MockFlight, float] | None = None
        told = self.parameters.values
        self._guided = Guided(self.vehicle.family, rules, told, home, self._modes, wind, speedup)

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        due = [self._next_beat]
        if self._period is not None:
            due.append(self._next_report)
        if self._flight is not None:
            due.append(self._flight.next_event)
        if self._firmware.deadline is not None:
            due.append(self._firmware.deadline)
        return min(due)

    def start(self, now: float) -> Sequence[Message]:
        """Boot."""
        self._booted = self._now = self._next_beat = self._next_report = now
        self._ready_at = now + self._boot
        return self.tick(now)

    def reboot(self, now: float) -> None:
        """Begin anew; what is stored stays, what is under way is lost."""
        self._firmware.reset()
        self.armed, self._flight, self._current = False, None, 0
        self._guided.reset()
        self._rest, self._broken_off = _AT_HOME, None
        self._booted, self._ready_at = now, now + self._boot

    def _time_out(self, now: float) -> Sequence[Message]:
        late = now - (self.deadline or now)
        if self._speedup > 1 and self._flight is not None and late > _LATE:
            self._flight.delay(late)
            self._booted += late
        self._now = now
        out: list[Message] = list(self._firmware.tick(now))
        if self._flight is not None:
            out += self._follow(self._flight, now)
        if self._guided.flying:
            out += self._follow_setpoints(now)
        if now >= self._next_beat:
            self._next_beat = now + self._beat
            out += [self._heartbeat(), self._mission_current(now), *self._system_status()]
            if self._tells_wanted:
                out.append(CurrentMode(self._mode, self._wanted))
        if self._period is not None and now >= self._next_report:
            self._next_report = now + self._period
            since_boot = (now - self._booted) * self._speedup
            told = telemetry(self._posture(now), self.home, since_boot)
            out += told if self._knows_place() else self._firmware.without_place(told)
        return out

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        self._now = now
        sender, message = envelope.sender, envelope.message
        if isinstance(message, Timesync):
            here = int((now - self._booted) * self._speedup * 1e9) + 1
            return [Timesync(here, message.ts1)] if message.tc1 == 0 else ()
        if isinstance(message, SetMode):
            target = Address(message.target_system, 0)
        elif isinstance(message, Addressed):
            target = message.target
        else:
            return ()
        own = self.address
        as_planner = Address(own.system, GROUND_STATION.component)  # PX4 takes it for its own
        if sender == own or not (own.takes(target) or as_planner.takes(target)):
            return ()
        match message:
            case CommandLong():
                return self._on_command(sender, message, now)
            case SetMode(custom_mode=mode):
                result = self._set_mode(mode, now)
                return [CommandAck(sender, 11, result)]  # the number of the message SET_MODE
            case ParamRequestList() | ParamRequestRead() | ParamSet():
                return self.parameters.on(message)
            case MissionSetCurrent(seq=seq):
                return self._set_current(seq, now)
            case SetPositionTargetLocalNed():
                out = self._come_back() if self._comes_back and self._guided.flying else ()
                self._guided.hear(message, self._mode, now)
                return out
        if self._firmware.silent_at_boot and not self._is_ready():
            return ()
        return self._firmware.on(envelope, now)

    def mission(self) -> Mission:
        """Return what is stored, as a mission."""
        return mission_of({part: self.lists.items(part) for part in MissionType}, self.vehicle)

    @property
    def mode(self) -> int:
        """The custom mode that it is in."""
        return self._mode

    @property
    def _is_mission(self) -> bool:
        """Whether the mode is to fly the mission."""
        return self._mode == self._modes.mission

    def _is_ready(self) -> bool:
        return self._now >= self._ready_at

    def _knows_place(self) -> bool:
        return self._now >= self._ready_at + self._place

    def _is_flying(self) -> bool:
        return self._flight is not None

    def _on_command(self, sender: Address, command: CommandLong, now: float) -> list[Message]:
        result, answers = ACCEPTED, list[Message]()
        match command.command:
            case MavCommand.ARM:
                result = self._arm(command.param1 >= 0.5, now)
                why = self._why_not_armed() if result == self._firmware.not_armed else None
                if why is not None:
                    text = self._firmware.not_armed_text.format(why)
                    answers.append(Statustext(MavSeverity.CRITICAL, text))
            case MavCommand.TAKEOFF:
                climbs = self._guided.take_off(command.param7, self._mode, now)
                result = ACCEPTED if climbs else DENIED
            case MavCommand.START if not self._knows_place():
                result = FAILED
            case MavCommand.START:
                self._mode = self._wanted = self._modes.mission
                result = self._begin(now)
            case MavCommand.SET_MODE:
                result = self._set_mode(self._firmware.requested_mode(command), now)
            case MavCommand.SET_CURRENT:
                found = self._set_current(whole(command.param1), now)
                result = ACCEPTED if found else DENIED
                answers += found
            case MavCommand.REQUEST_MESSAGE | MavCommand.REQUEST_CAPABILITIES as asked:
                by_number = asked == MavCommand.REQUEST_MESSAGE
                kind = whole(command.param1) if by_number else _AUTOPILOT_VERSION
                answers += self._asked_for(kind)
                result = ACCEPTED if answers else UNSUPPORTED
            case MavCommand.SET_INTERVAL if command.param1 == CURRENT_MODE:
                self._tells_wanted = self._comes_back
            case MavCommand.SET_INTERVAL:
                asked = whole(command.param2)  # microseconds; 0: the usual rate
                if command.param1 == POSITION and asked > 0 and self._period is not None:
                    self._period = asked / 1e6 / self._speedup
            case MavCommand.REBOOT:
                self.reboot(now)
            case _:
                result = UNSUPPORTED
        ack = CommandAck(sender, command.command, result)
        return [ack, *answers]

    def _asked_for(self, kind: int) -> list[Message]:
        if kind == _AUTOPILOT_VERSION:
            return [AutopilotVersion(_CAPABILITIES, 0x04_06_00_FF, self.address.system)]
        if kind == POSITION:
            told = telemetry(self._posture(self._now), self.home, self._now - self._booted)
            return told[:1] if self._knows_place() else self._firmware.without_place(told[:1])
        if kind in (HOME_POSITION, LOCAL_ORIGIN):
            home = self.home
            place = (round(home.latitude * 1e7), round(home.longitude * 1e7))
            spot = HomePosition if kind == HOME_POSITION else GpsGlobalOrigin
            return [spot(*place, round(home.altitude * 1000))]
        return []

    def _arm(self, wanted: bool, now: float) -> int:
        if not wanted:
            self.armed, self._flight, self._broken_off = False, None, None
            self._guided.reset()
            return ACCEPTED
        if self._why_not_armed() is not None:
            return self._firmware.not_armed
        self.armed = True
        if self._mode == self._modes.guided:
            self._begin_guided(now)
        return self._begin(now) if self._is_mission else ACCEPTED

    def _why_not_armed(self) -> str | None:
        """Return what it says when it does not arm, None if it does."""
        if not self._is_ready():
            return "Calibrating"
        if self._mode in self._modes.not_to_arm_in:
            return "Mode not armable"
        return "Vehicle breaching Polygon fence" if self._is_kept_on_ground() else None

    def _set_mode(self, mode: int | None, now: float) -> int:
        if mode is None:
            return self._firmware.no_mode
        if mode == self._modes.mission and self._problem() is not None:
            return self._firmware.mode_denied
        if mode == self._modes.guided and not self._guided.accepts(now):
            return self._firmware.mode_denied
        self._mode = self._wanted = mode
        if self._guided.flying and mode not in (self._modes.guided, self._modes.mission):
            self._guided.leave(mode, now)
        elif self.armed and mode == self._modes.guided:
            self._begin_guided(now)
        if not self._is_mission:
            if self._flight is not None:
                self._rest = replace(self._flight.at(now), velocity=np.zeros(3))
                self._broken_off, self._flight = (self._flight, now), None
            return ACCEPTED
        return self._begin(now)

    def _problem(self) -> str | None:
        """Return why what is stored cannot be flown, or None."""
        try:
            mission = self.mission()
        except InputError as error:  # peers store what they like
            return str(error)
        if not mission.items:
            return "no mission"
        return self._firmware.infeasible(mission)

    def _begin(self, now: float) -> int:
        """Fly, once armed and told to; not a second time."""
        if self._problem() is not None or self._fly is None:
            return DENIED
        if self.armed and self._flight is None and self._broken_off is not None:
            self._flight, since = self._broken_off
            self._flight.delay(now - since)
            self._broken_off = None
        elif self.armed and self._flight is None:
            mission = replace(self.mission(), home=self.home)
            try:
                track = self._fly(mission, self._vehicle_now())
            except InputError:
                return DENIED
            if self._guided.flying:
                track = taken_up(track, self._guided.at(now), self._vehicle_now())
                self._guided.reset()
            track, breach = kept_inside(track, mission.fence, self._vehicle_now())
            self._flight = MockFlight(track, mission.items, now, self._speedup, breach)
        return ACCEPTED

    def _follow(self, flight: MockFlight, now: float) -> list[Message]:
        out = flight.reached(now, self._first_number())
        if (breach := flight.breached(now)) is not None:
            self._mode = self._modes.at_fence.get(breach.action, self._mode)
            out += [*self._firmware.fence_texts, self._heartbeat()]
        current = flight.at(now).item + self._first_number()
        if current != self._current:
            self._current = current
            if self.vehicle.kind in self._firmware.returns_by_mode and self._is_return(current):
                self._mode = self._modes.at_fence["return"]
                out.append(self._heartbeat())
            out.append(self._mission_current(now))
        if flight.ended(now) and flight.lands:
            self._rest, self._flight, self.armed = flight.at(now), None, False
            out.append(Statustext(MavSeverity.INFO, "Landed, disarming"))
            out.append(self._heartbeat())
        return out

    def _begin_guided(self, now: float) -> None:
        if not self._guided.flying:
            self._guided.begin(self._posture(now), self._vehicle_now(), now)
            self._flight = self._broken_off = None

    def _follow_setpoints(self, now: float) -> list[Message]:
        if self._guided.landed(now):
            self._rest, self.armed = self._guided.at(now), False
            self._guided.reset()
            return [Statustext(MavSeverity.INFO, "Landed, disarming"), self._heartbeat()]
        before, self._mode = self._mode, self._guided.lost(self._mode, now)
        return [self._heartbeat()] if self._mode != before else []

    def _come_back(self) -> list[Message]:
        """End the failsafe for lost setpoints, now that they come again."""
        if self._wanted != self._modes.guided or self._mode == self._wanted:
            return []
        self._mode = self._wanted
        return [self._heartbeat(), CurrentMode(self._mode, self._wanted)]

    def _is_return(self, seq: int) -> bool:
        rows = self.lists.items(MissionType.MISSION)
        return seq < len(rows) and rows[seq].command == Command.NAV_RETURN_TO_LAUNCH

    def _is_kept_on_ground(self) -> bool:
        """Tell whether it does not arm because of its fence."""
        try:
            fence = self.mission().fence
        except InputError:  # peers store what they like
            return False
        inside_only = self._firmware.armed_inside_only
        return inside_only and home_outside(fence, self.home, self._vehicle_now())

    def _vehicle_now(self) -> Vehicle:
        """Return the vehicle with the parameters that it has been given; useless ones count not."""
        family = self.vehicle.family.key
        return Vehicle(family, self.vehicle.kind, self.parameters.values).usable()

    def _first_number(self) -> int:
        return home_items(self.vehicle, MissionType.MISSION)

    def _posture(self, now: float) -> Posture:
        if self._guided.flying:
            return self._guided.at(now)
        return self._rest if self._flight is None else self._flight.at(now)

    def _set_current(self, seq: int, now: float) -> list[Message]:
        if not 0 <= seq < len(self.lists.items(MissionType.MISSION)):
            return []
        self._current = seq
        return [self._mission_current(now)]

    def _mission_current(self, now: float) -> Message:
        total = len(self.lists.items(MissionType.MISSION)) - self._first_number()
        # MISSION_STATE: none, not started, active
        state = 1 if total == 0 else 3 if self._flight is not None else 2
        if self._flight is not None and now >= self._flight.end:
            state = MISSION_COMPLETE
        number = self.lists.number(MissionType.MISSION) if self._firmware.numbers_missions else 0
        return MissionCurrent(self._current, max(total, 0), state, number)

    def _system_status(self) -> list[Message]:
        """Return that its checks pass, once it is ready, and how its battery is."""
        passes = PREARM_CHECK * self._is_ready()
        return [SysStatus(passes, 12_600, self._battery), BatteryStatus(0, 1, self._battery)]

    def _heartbeat(self) -> Message:
        if not self._is_ready():
            state = MavState.CALIBRATING
        else:
            state = MavState.ACTIVE if self.armed else MavState.STANDBY
        autopilot = self.vehicle.family.mav_autopilot
        base_mode = _CUSTOM_MODE | _AUTO * self._is_mission | ARMED * self.armed
        return Heartbeat(self.vehicle.mav_types[0], autopilot, base_mode, self._mode, state)
