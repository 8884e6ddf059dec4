"""The mock autopilot: a vehicle without sockets or clock."""

from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from typing import TypeAlias

import numpy as np

from faao_mav.mavlink.messages import (
    AutopilotVersion,
    CommandAck,
    CommandLong,
    Envelope,
    Heartbeat,
    HomePosition,
    Message,
    MissionCurrent,
    MissionSetCurrent,
    ParamRequestList,
    ParamRequestRead,
    ParamSet,
    SetMode,
    Statustext,
)
from faao_mav.mavlink.mock.ardupilot import ArduPilotServer
from faao_mav.mavlink.mock.feasible import infeasible
from faao_mav.mavlink.mock.flight import Flight, Posture, telemetry
from faao_mav.mavlink.mock.lists import Lists
from faao_mav.mavlink.mock.manners import Manners
from faao_mav.mavlink.mock.modes import Modes, whole
from faao_mav.mavlink.mock.parameters import Parameters
from faao_mav.mavlink.mock.px4 import Px4Server
from faao_mav.mavlink.rows import mission_of
from faao_mav.mavlink.transfer.protocol import ARMED, Address, Autopilot, MissionType, State
from faao_mav.mission.item import Home, Mission
from faao_mav.plan.autopilots import Autopilot as Family
from faao_mav.plan.autopilots import Kind
from faao_mav.vehicle import Track, Vehicle

Fly: TypeAlias = Callable[[Mission], Track]

ACCEPTED, REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3
"""MAV_RESULT."""


class Cmd(IntEnum):
    """MAV_CMD outside of missions."""

    SET_MODE = 176
    SET_CURRENT = 224
    REBOOT = 246
    START = 300
    ARM = 400
    SET_INTERVAL = 511
    REQUEST_MESSAGE = 512
    REQUEST_CAPABILITIES = 520


_AUTOPILOT_VERSION, _HOME_POSITION = 148, 242
_MAV_TYPES: dict[Kind, int] = {"copter": 2, "plane": 1}  # quadrotor, fixed wing
_INFO = 6
# MISSION_FLOAT, MISSION_INT, COMMAND_INT, MAVLINK2, MISSION_FENCE, MISSION_RALLY
_CAPABILITIES = 1 | 4 | 8 | 8192 | 16_384 | 32_768
_AT_REST = Posture(np.zeros(3), np.zeros(3), 0)


class MockAutopilot:
    """It takes missions as ArduPilot or PX4 does, and flies them along `fly`'s track.

    `aircraft` is what its heartbeats say that it is, and whose missions it stores.
    It boots for `boot` seconds, in which it refuses lists. Armed and set to the mission it flies
    what it holds, `speedup` times as fast as predicted, reports its position `rate` times a
    second, and disarms where the flight ends on the ground. Heartbeats are `beat` seconds apart.
    `parameters` are told beside its defaults; what they do to the flight is up to `fly`.
    """

    outcome: None = None
    progress = ("flying", 0, 0)

    def __init__(
        self,
        manners: Manners | None = None,
        *,
        aircraft: Kind = "copter",
        address: Address = Address(1, 1),  # noqa: B008
        home: Home = Home(-35.363262, 149.165237, 584.0),  # noqa: B008
        fly: Fly | None = None,
        parameters: Mapping[str, float] | None = None,
        speedup: float = 1.0,
        rate: float = 4.0,
        beat: float = 1.0,
        boot: float = 0.0,
    ) -> None:
        self.manners = manners or Manners()
        self.address, self.home = address, home
        autopilot: Family = "ardupilot" if self.manners.kind == "ardupilot" else "px4"
        self._modes, self._type = Modes(autopilot, aircraft), _MAV_TYPES[aircraft]
        self.lists = Lists(Vehicle(autopilot, aircraft), home)
        self.parameters = Parameters(autopilot, parameters)
        self._server: ArduPilotServer | Px4Server = (
            ArduPilotServer(self.lists, self.manners, self._is_ready, self._is_flying)
            if autopilot == "ardupilot"
            else Px4Server(self.lists, self.manners)
        )
        self._fly, self._speedup = fly, speedup
        self._period = 1 / rate if rate > 0 else None
        self._beat = beat
        self._boot = boot
        self._booted = self._ready_at = self._now = 0.0
        self._next_beat = self._next_report = 0.0
        self._armed = False
        self._current = 0
        self._flight: Flight | None = None

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        due = [self._next_beat]
        if self._period is not None:
            due.append(self._next_report)
        if self._flight is not None:
            due.append(self._flight.next_event)
        if self._server.deadline is not None:
            due.append(self._server.deadline)
        return min(due)

    @property
    def armed(self) -> bool:
        """Whether the motors may turn."""
        return self._armed

    def start(self, now: float) -> Sequence[Message]:
        """Boot."""
        self._booted = self._now = self._next_beat = self._next_report = now
        self._ready_at = now + self._boot
        return self.tick(now)

    def reboot(self, now: float) -> None:
        """Begin anew; what is stored stays, what is under way is lost."""
        self._server.reset()
        self._armed, self._flight, self._current = False, None, 0
        self._booted, self._ready_at = now, now + self._boot

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Say nothing: a vehicle does not take leave."""
        return ()

    def tick(self, now: float) -> Sequence[Message]:
        """Send what is due."""
        self._now = now
        out: list[Message] = list(self._server.tick(now))
        if self._flight is not None:
            out += self._follow(self._flight, now)
        if now >= self._next_beat:
            self._next_beat = now + self._beat
            out += [self._heartbeat(), self._mission_current()]
        if self._period is not None and now >= self._next_report:
            self._next_report = now + self._period
            out += telemetry(self._posture(now), self.home, now - self._booted)
        return out

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Answer what is addressed to this vehicle."""
        self._now = now
        sender, message = envelope.sender, envelope.message
        system = getattr(message, "target_system", None)
        component = getattr(message, "target_component", 0)
        own = self.address
        for_me = system in (0, own.system) and component in (0, own.component, 190)
        if not for_me or sender == own:
            return ()
        match message:
            case CommandLong():
                return self._on_command(sender, message, now)
            case SetMode(custom_mode=mode):
                result = self._set_mode(mode, now)
                return [CommandAck(11, result, sender.system, sender.component)]
            case ParamRequestList() | ParamRequestRead() | ParamSet():
                return self.parameters.on(message)
            case MissionSetCurrent(seq=seq):
                return self._set_current(seq)
        if not self._is_ready() and isinstance(self._server, Px4Server):
            return ()
        return self._server.on(envelope, now)

    def mission(self) -> Mission:
        """Return what is stored, as a mission."""
        rows = [self.lists.rows(part) for part in MissionType]
        return mission_of(rows[0], rows[1], rows[2], self._modes.autopilot)

    def _is_ready(self) -> bool:
        return self._now >= self._ready_at

    def _is_flying(self) -> bool:
        return self._flight is not None

    def _on_command(self, sender: Address, command: CommandLong, now: float) -> list[Message]:
        result, answers = ACCEPTED, list[Message]()
        match command.command:
            case Cmd.ARM:
                result = self._arm(command.param1 >= 0.5, now)
            case Cmd.START:
                self._modes.set_mission()
                result = self._begin(now)
            case Cmd.SET_MODE:
                result = self._set_mode(self._modes.of_command(command), now)
            case Cmd.SET_CURRENT:
                found = self._set_current(whole(command.param1))
                result = ACCEPTED if found else DENIED
                answers += found
            case Cmd.REQUEST_MESSAGE | Cmd.REQUEST_CAPABILITIES as asked:
                by_number = asked == Cmd.REQUEST_MESSAGE
                kind = whole(command.param1) if by_number else _AUTOPILOT_VERSION
                answers += self._asked_for(kind)
                result = ACCEPTED if answers else UNSUPPORTED
            case Cmd.SET_INTERVAL:
                pass
            case Cmd.REBOOT:
                self.reboot(now)
            case _:
                result = UNSUPPORTED
        ack = CommandAck(command.command, result, sender.system, sender.component)
        return [ack, *answers]

    def _asked_for(self, kind: int) -> list[Message]:
        if kind == _AUTOPILOT_VERSION:
            return [AutopilotVersion(_CAPABILITIES, 0x04_06_00_FF, self.address.system)]
        if kind == _HOME_POSITION:
            home = self.home
            place = (round(home.latitude * 1e7), round(home.longitude * 1e7))
            return [HomePosition(*place, round(home.altitude * 1000))]
        return []

    def _arm(self, wanted: bool, now: float) -> int:
        if not wanted:
            self._armed, self._flight = False, None
            return ACCEPTED
        if not self._is_ready():
            return REJECTED
        self._armed = True
        return self._begin(now) if self._modes.is_mission else ACCEPTED

    def _set_mode(self, mode: int, now: float) -> int:
        if self._modes.would_be_mission(mode) and self._problem() is not None:
            return DENIED
        self._modes.custom_mode = mode
        if not self._modes.is_mission:
            self._flight = None
            return ACCEPTED
        return self._begin(now)

    def _problem(self) -> str | None:
        """Return why what is stored cannot be flown, or None."""
        mission = self.mission()
        if not mission.items:
            return "no mission"
        return infeasible(mission) if self._modes.autopilot == "px4" else None

    def _begin(self, now: float) -> int:
        """Fly, once armed and told to; not a second time."""
        if self._problem() is not None or self._fly is None:
            return DENIED
        if self._armed and self._flight is None:
            mission = self.mission()
            track = self._fly(Mission(mission.items, self.home, mission.fence, mission.rally))
            self._flight = Flight(track, mission.items, now, self._speedup)
        return ACCEPTED

    def _follow(self, flight: Flight, now: float) -> list[Message]:
        out = flight.reached(now, self._first_number())
        current = flight.at(now).item + self._first_number()
        if current != self._current:
            self._current = current
            out.append(self._mission_current())
        if now >= flight.end and flight.lands:
            self._flight, self._armed = None, False
            out.append(Statustext(_INFO, "Landed, disarming"))
            out.append(self._heartbeat())
        return out

    def _first_number(self) -> int:
        return int(self._modes.autopilot == "ardupilot")

    def _posture(self, now: float) -> Posture:
        return _AT_REST if self._flight is None else self._flight.at(now)

    def _set_current(self, seq: int) -> list[Message]:
        if not 0 <= seq < len(self.lists.rows(MissionType.MISSION)):
            return []
        self._current = seq
        return [self._mission_current()]

    def _mission_current(self) -> Message:
        total = len(self.lists.rows(MissionType.MISSION)) - self._first_number()
        # MISSION_STATE: none, not started, active
        state = 1 if total == 0 else 3 if self._flight is not None else 2
        return MissionCurrent(self._current, max(total, 0), state)

    def _heartbeat(self) -> Message:
        if not self._is_ready():
            state = State.CALIBRATING
        else:
            state = State.ACTIVE if self._armed else State.STANDBY
        autopilot = Autopilot.ARDUPILOT if self._modes.autopilot == "ardupilot" else Autopilot.PX4
        base_mode = self._modes.base_mode | (ARMED if self._armed else 0)
        return Heartbeat(self._type, autopilot, base_mode, self._modes.custom_mode, state)
