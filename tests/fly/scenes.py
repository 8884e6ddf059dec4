"""A mock autopilot and a watch of it on a simulated link, as a row of words sets it up.

`test_scenes.py` says what the words are.
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import astuple, replace
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias, cast

import numpy as np
from conftest import FLYABLE, changes_in, edited
from simulate import Station, simulate
from stations import FOREIGN, HOME, RALLY, VEHICLE, a_mission, peer_of, rows_for, vehicle_of

from faao_mav import optimize, parse_plan
from faao_mav.autopilot import Track, Vehicle
from faao_mav.autopilot.predict import predict
from faao_mav.fly.itinerary import LEVEL, NEAR
from faao_mav.fly.preflight import Clearance, Flight
from faao_mav.fly.stream import Stream
from faao_mav.fly.watch import Watch
from faao_mav.geodesy import LocalFrame
from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.solution import Solution
from faao_mav.sim import MockAutopilot, MockKind, behaviour_of
from faao_mav.sim.faults import Faults
from faao_mav.wire import messages, protocol
from faao_mav.wire.jobs import Held
from faao_mav.wire.machine import AT_ONCE, Script, Talk
from faao_mav.wire.messages import CommandLong, Envelope, Heartbeat, Message, ParamSet
from faao_mav.wire.parameters import Reading
from faao_mav.wire.protocol import GROUND_STATION, Address, MavCommand, MissionType
from faao_mav.wire.wire_items import wire_items

DATA = Path(__file__).parents[1] / "data" / "fly"

METRE = 1e7 / 111_319.5
"""A metre of latitude in 1e-7 degrees."""

LOITER = 5
"""A pilot's mode, of ArduCopter: PX4 knows no such number, and the mock takes any."""

# ---- what is flown

CAP = NEAR + 8**2 / (2 * 1.6)
"""The farthest, m, that the gate lets the swift flight be sent."""

PLANS = changes_in(DATA / "plans.yaml")
"""Flights by setpoints, as changes of the small plan."""

FAR = MissionItem(16, 3, x=HOME.latitude + 0.01, y=HOME.longitude, z=30.0)
MISSIONS = {
    "far": Mission((a_mission(3).items[0], FAR, MissionItem(20, 2)), HOME),
    "hovering": Mission(a_mission(12).items[:-1], HOME),
}


@cache
def planned(flight: str) -> Solution:
    return optimize(parse_plan(edited(FLYABLE, PLANS[flight])))


def under(changes: dict[str, Any]) -> Solution:
    """Return the low flight for a plan that has what does not change it otherwise."""
    plan = parse_plan(edited(FLYABLE, PLANS["low"] | changes))
    return replace(planned("low"), problem=build_problem(plan))


def away(metres: float, higher: float = 0.0) -> Home:
    """Return a place so many metres east of home."""
    frame = LocalFrame(HOME.latitude, HOME.longitude)
    latitude, longitude = frame.to_geodetic([metres, 0.0])
    return Home(float(latitude), float(longitude), HOME.altitude + higher)


FORESEEN: dict[str, Track] = {}


def foreseen(mission: Mission, vehicle: Vehicle, **how: Any) -> Track:
    """Return the predicted flight, which many scenes have in common."""
    key = repr((astuple(mission), vehicle, how))
    FORESEEN[key] = FORESEEN.get(key) or predict(mission, vehicle, **how)
    return FORESEEN[key]


def fly(mission: Mission, _: Vehicle) -> Track:
    """Return the flight of an ArduCopter, four times as fast."""
    track = foreseen(mission, Vehicle())
    return replace(track, t=track.t / 4, velocity=4 * track.velocity, reached=track.reached / 4)


# ---- the scene

MODES: dict[str, dict[str, int]] = {
    "ardupilot": {"mission": 3, "guided": 4, "loiter": 5, "return": 6, "land": 9, "hold": 17},
    "px4": {
        "loiter": 5,
        "guided": 6 << 16,
        **{name: 4 << 16 | n << 24 for n, name in ((3, "hold"), (4, "mission"), (5, "return"))},
        "land": 4 << 16 | 6 << 24,
    },
}
TIMED = {"ardupilot": {"WPNAV_ACCEL": 250.0}, "px4": {"MPC_ACC_HOR": 3.0}}
ORDERS: dict[str, tuple[int, float]] = {
    "arm": (MavCommand.ARM, 1.0),
    "disarm": (MavCommand.ARM, 0.0),
    "start": (MavCommand.START, 0.0),
    "mode": (MavCommand.SET_MODE, 1.0),
}

Picks: TypeAlias = Callable[[Message], bool]
Lens: TypeAlias = Callable[[Message, float], Sequence[Message]]


def is_setpoint(message: object) -> bool:
    return isinstance(message, messages.SetPositionTargetLocalNed)


def arms(message: object, wanted: float | None = None) -> bool:
    """Tell whether a message is an order to arm, or to disarm."""
    ordered = isinstance(message, CommandLong) and message.command == MavCommand.ARM
    return ordered and wanted in (None, getattr(message, "param1", None))


def starts(message: object) -> bool:
    """Tell whether a message is an order to start, or to take off."""
    return getattr(message, "command", None) in (MavCommand.START, MavCommand.TAKEOFF)


def harmless(message: Message) -> bool:
    """Tell whether a message only asks for something."""
    asked = (MavCommand.SET_INTERVAL, MavCommand.REQUEST_MESSAGE)
    asks = isinstance(message, CommandLong) and message.command in asked
    lists = messages.MissionRequestList | messages.MissionRequestInt | messages.MissionAck
    return asks or isinstance(message, lists | messages.ParamRequestRead | messages.Timesync)


PICKED: dict[str, Picks] = {
    "all": lambda _: True,
    "arm": lambda message: arms(message, 1.0),
    "disarm": lambda message: arms(message, 0.0),
    "start": starts,
    "mode": lambda message: getattr(message, "command", None) == MavCommand.SET_MODE,
    "setpoints": is_setpoint,
    "lists": lambda message: isinstance(message, messages.MissionRequestList),
    "hold": lambda message: (
        isinstance(message, CommandLong)
        and message.command == MavCommand.SET_MODE
        and (message.param2, message.param3) in ((MODES["ardupilot"]["hold"], 0), (4, 3))
    ),
    "land": lambda message: getattr(message, "param2", None) == MODES["ardupilot"]["land"],
}


def holding(mission: Mission, mock: MockAutopilot) -> MockAutopilot:
    """Return `mock`, which holds `mission` now."""
    for part in MissionType:
        mock.lists.replace(part, wire_items(mission, part, vehicle_of(mock.behaviour.family.key)))
    return mock


def held_by(mock: MockAutopilot, untold: Collection[str] = ()) -> Held:
    """Return what `mock` holds, as if it had been read, without the parameters `untold`."""
    values = mock.parameters.values.items()
    told = {name: value for name, value in values if name not in untold}
    lists = {part: mock.lists.items(part) for part in MissionType}
    return Held(lists, Reading(told), home=mock.home)


class Scene:
    """A mock autopilot that holds a mission, and a watch of it on a simulated link.

    With a `solution` that is flown by setpoints. `events` happen at their times, s, with `others`
    on the link, which has `faults`. What is sent is judged by `client`.
    """

    def __init__(
        self,
        kind: str,
        mission: Mission | None = None,
        *,
        arm: bool = False,
        lands: bool = True,
        solution: Solution | None = None,
        elsewhere: bool = False,
        **options: Any,
    ) -> None:
        mission = mission or a_mission(12)
        if solution is not None:
            options["parameters"] = {"GUID_TIMEOUT": 1.0, **options.get("parameters", {})}
        behaviour = behaviour_of(cast(MockKind, kind))
        self.home = options.setdefault("home", HOME)
        self.mock: Any = holding(mission, MockAutopilot(behaviour, **options))
        self.mock.flight._fly = fly
        timed = Vehicle(kind, "copter", TIMED[kind])
        flight = Flight(mission, timed, solution=solution, streamed=solution is not None)
        gate = Clearance(flight, peer_of(kind), held_by(self.mock), elsewhere)
        self.watch: Any = Stream(gate) if solution else Watch(gate, arm=arm, lands=lands)
        self.kind, self.solution, self.faults, self.until = kind, solution, Faults(), 300.0
        self.events, self.others = list[tuple[float, Any]](), list[Station]()
        self.client = Judge(self)

    def run(self, looks: Sequence[tuple[float, Callable[[float], object]]] = ()) -> str:
        """Return the kind of the ending, "-" for none; `looks` are called at their times."""
        stations = Station(self.client, GROUND_STATION), Station(self.mock, VEHICLE)
        events = [*self.events, *looks]
        simulate(*stations, self.faults, self.until, events=events, others=self.others)
        return self.watch.outcome.kind if self.watch.outcome is not None else "-"

    @property
    def orders(self) -> list[Message]:
        """What was sent that moves the vehicle: everything but requests for telemetry."""
        return [each for each in self.client.sent if not harmless(each)]

    @property
    def commands(self) -> list[tuple[int, float]]:
        """The commands that were given, with their first parameters."""
        orders = (each for each in self.orders if isinstance(each, CommandLong))
        return [(each.command, each.param1) for each in orders]

    def after(self, begin: float, end: float = math.inf) -> int:
        """Return how many setpoints were sent after `begin`, s, and before `end`."""
        return sum(begin < t < end for t, _ in self.client.setpoints)

    # ---- what happens to it

    def tells(self, lens: Lens) -> None:
        """Let the vehicle send what `lens` makes of each of its messages, and the time."""
        tick, on = self.mock.tick, self.mock.on

        def through(messages: Sequence[Message], now: float) -> list[Message]:
            return [told for message in messages for told in lens(message, now)]

        self.mock.tick = lambda now: through(tick(now), now)
        self.mock.on = lambda envelope, now: through(on(envelope, now), now)

    def loses(
        self,
        picked: Picks,
        begin: float = 0.0,
        end: float = math.inf,
        *,
        heard: bool = False,
        denied: int | None = None,
    ) -> None:
        """Let some messages to the vehicle be lost; or, where it is `heard`, the answers to them.

        A command that is `denied` is answered so.
        """
        on = self.mock.on
        denial = () if denied is None else (messages.CommandAck(GROUND_STATION, denied, 4),)

        def hear(envelope: Envelope, now: float) -> Sequence[Message]:
            lost = picked(envelope.message) and begin <= now < end
            answers: Sequence[Message] = on(envelope, now) if heard or not lost else ()
            return denial if lost else answers

        self.mock.on = hear

    def _event(self, word: str, *words: str) -> Callable[[float], object]:
        """Return what happens at a time: it is called with that."""
        mock, part = self.mock, MissionType.MISSION
        rows = list(mock.lists.items(part))
        match word:
            case "interrupt":
                return self.client.interrupt
            case "hang-up":
                return self.client.hang_up
            case "reboot":
                return lambda now: mock.reboot(now)
            case "carried":
                return lambda _: setattr(mock, "home", away(60.0))
            case "current":
                return lambda _: setattr(mock, "_current", int(words[0]))
            case "parameter":
                message = ParamSet(VEHICLE, words[0], float(words[1]), 9)
                return lambda now: mock.on(Envelope(GROUND_STATION, message), now)
            case "answer":  # to an order of ours, or of another station
                to = FOREIGN if "other" in words else GROUND_STATION
                answer = messages.CommandAck(to, ORDERS[words[0]][0], int(words[1]))
                return lambda now: self.client.on(Envelope(VEHICLE, answer), now)
            case "shorten":
                rows = rows[:-2]
            case "change":  # an item of its mission
                rows[5] = rows_for(self.kind, 12, shift=1e-4)[5]
            case "rally":
                part = MissionType.RALLY
                rows = [*wire_items(a_mission(5, rally=RALLY), part, vehicle_of(self.kind))]
            case _:  # somebody else gives an order, or the pilot sets a mode
                order: Message = (
                    CommandLong(VEHICLE, ORDERS[word][0], 0, ORDERS[word][1])
                    if word in ORDERS
                    else messages.SetMode(1, 1, MODES[self.kind][word])
                )
                return lambda now: mock.on(Envelope(FOREIGN, order), now)
        return lambda _: mock.lists.replace(part, rows)


class Judge:
    """A watch whose every message is judged as it is sent: `wrong` is what must not happen.

    `setpoints` are when each was sent, s, and to what height above home, m.
    """

    def __init__(self, scene: Scene, *, may_start: bool = True) -> None:
        self.machine: Any = scene.watch
        self.scene, self.may_start = scene, may_start
        self.sent = list[Message]()
        self.wrong, self.setpoints = list[str](), list[tuple[float, float]]()
        self._told: messages.GlobalPositionInt | None = None
        self._mode: int | None = None
        self._ordered, self._pilots, self._asked_at = False, False, 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self.machine, name)

    def start(self, now: float) -> Sequence[Message]:
        return self._note(self.machine.start(now))

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        if envelope.sender == VEHICLE:
            self._hear(envelope.message)
        return self._judged(self._note(self.machine.on(envelope, now)), now)

    def tick(self, now: float) -> Sequence[Message]:
        sent, watch = self._judged(self._note(self.machine.tick(now)), now), self.machine
        unsure = watch.streams and watch._unsure_since is not None
        if watch.outcome is not None or not watch._is_to_hold or unsure:
            self._asked_at = now
        elif now > self._asked_at + 2.1:
            self.wrong.append(f"{now:.1f} s: the hold is not asked for any more")
        return sent

    def hang_up(self, now: float) -> Sequence[Message]:
        return self._note(self.machine.hang_up(now))

    def _note(self, messages: Sequence[Message]) -> Sequence[Message]:
        self.sent += messages
        return messages

    def interrupt(self, now: float) -> None:
        """Press Ctrl-C; what is sent then is lost at first."""
        if self.machine.outcome is None:
            self._note(self.machine.cancel(now))

    def _hear(self, message: Message) -> None:
        match message:
            case messages.GlobalPositionInt(time_boot_ms=t):
                if self._told is None or t > self._told.time_boot_ms:
                    self._told = message
            case Heartbeat(custom_mode=mode):
                took = mode == LOITER and self._mode != LOITER
                self._pilots |= self._ordered and took
                self._mode = mode

    def _judged(self, sent: Sequence[Message], now: float) -> Sequence[Message]:
        for message in sent:
            if harmless(message):
                continue
            self._ordered, self._asked_at = True, now
            if arms(message, 1.0) and not self.may_start:
                self.wrong.append(f"{now:.1f} s: armed")
            if self._pilots:
                self.wrong.append(f"{now:.1f} s: {type(message).__name__} to what a pilot has")
            if isinstance(message, messages.SetPositionTargetLocalNed):
                self._measure(message, now)
        return sent

    def _measure(self, setpoint: messages.SetPositionTargetLocalNed, now: float) -> None:
        """Compare where it is sent with where it said that it is, which is behind by a `lead`."""
        told, faults, home = self._told, self.scene.faults, self.scene.home
        assert self.scene.solution is not None
        assert told is not None
        plan = self.scene.solution.plan
        own = self.machine._family.local_frame(home.latitude, home.longitude)
        to = plan.origin.frame.to_local(*own.to_geodetic([setpoint.y, setpoint.x]))
        place = plan.origin.frame.to_local(told.lat / 1e7, told.lon / 1e7)
        self.setpoints.append((now, -setpoint.z))
        up = home.altitude - setpoint.z - told.alt / 1000
        across, speed = float(np.hypot(*(to - place))), plan.max_ground_speed
        lead = min(2 * (faults.latency + faults.delay), 1.0) + 0.05
        cap = NEAR + speed**2 / (2 * plan.vehicle.max_acceleration) + speed * lead
        if across > cap or abs(up) > LEVEL + 2.0 + speed * lead:
            self.wrong.append(f"{now:.1f} s: sent {across:.1f} m away, {up:+.1f} m up")
        far, straight = across > NEAR + speed * lead, np.array([place, to])
        if far and plan.keep_in is not None and not plan.keep_in.covers_path(straight):
            self.wrong.append(f"{now:.1f} s: sent across the fence, {across:.1f} m")


def speaks(since: float, says: Callable[[float], Sequence[Message]]) -> Talk[None]:
    """Say something three times a second, from a given time on, whatever is heard."""
    line = yield AT_ONCE
    due = line.now + since
    while True:
        line = yield due
        if line.now >= due:
            line.say(*says(line.now))
            due = line.now + 0.3


def as_station(_: float) -> Sequence[Message]:
    return [Heartbeat(protocol.GROUND_STATION_TYPE, protocol.NO_AUTOPILOT, 0, 0, 4)]


def as_companion(now: float) -> Sequence[Message]:
    """Tell a place and a mode of one's own, as a computer on board."""
    ms, place = round(now * 1000) + 5000, (round(HOME.latitude * 1e7), round(1e9), 9000, 9000)
    return [Heartbeat(18, 8, 0, LOITER, 4), messages.GlobalPositionInt(ms, *place, 0, 0, 0, 0)]


# ---- a scene in words

SPEAKERS = {
    "station": (FOREIGN, as_station),
    "twin": (GROUND_STATION, as_station),
    "companion": (Address(1, 191), as_companion),
}
FAULTS = ("loss", "seed", "reordering", "delay", "duplication", "latency")


def positions(change: Callable[..., messages.GlobalPositionInt]) -> Callable[..., Lens]:
    """Return what makes a lens: positions of some time are changed, by numbers beside them."""

    def lens(begin: float, end: float, *numbers: float) -> Lens:
        first: list[messages.GlobalPositionInt] = []

        def told(said: Message, now: float) -> Sequence[Message]:
            if not isinstance(said, messages.GlobalPositionInt) or not begin <= now < end:
                return [said]
            first.append(said)
            return [change(said, first[0], *numbers)]

        return told

    return lens


def blind(begin: float, _: float) -> Lens:
    return lambda said, now: [said][isinstance(said, messages.GlobalPositionInt) and now > begin :]


def hold_up(begin: float, end: float) -> Lens:
    """Hold back all that the vehicle says, and then deliver it at once."""
    held = list[Message]()

    def bursts(said: Message, now: float) -> Sequence[Message]:
        held.append(said)
        out = [] if begin <= now < end else held[:]
        del held[: len(out)]
        return out

    return bursts


def lag(*_: float) -> Lens:
    """Tell the item under way a message later, which is a second."""
    told: list[Message] = []

    def late(said: Message, _: float) -> Sequence[Message]:
        if isinstance(said, messages.MissionCurrent):
            told.append(said)
            return told[-2:-1] or [said]
        return [said]

    return late


def modeless(begin: float, end: float) -> Lens:
    """Tell no modes, as where they come after positions when the link is back."""
    modes = messages.Heartbeat | messages.CurrentMode
    return lambda said, now: [said][isinstance(said, modes) and begin <= now < end :]


LENSES: dict[str, Callable[..., Lens]] = {
    "blind": blind,
    "hold-up": hold_up,
    "lag": lag,
    "modeless": modeless,
    "jump": positions(lambda p, _, north: replace(p, lat=p.lat + round(north * METRE))),
    "stuck": positions(lambda p, first: replace(first, time_boot_ms=p.time_boot_ms)),
    "leap": positions(
        lambda p, _, by: replace(p, time_boot_ms=max(p.time_boot_ms + round(1000 * by), 0))
    ),
    "higher": positions(lambda p, _, by: replace(p, relative_alt=p.relative_alt - int(1000 * by))),
}
"""What becomes of what the vehicle says: places jump or stand, its clock leaps, home moves."""


def staged(flies: str, kind: str, given: Mapping[str, str], happens: str = "") -> Scene:
    """Return a scene as it is set up by its words."""
    numbers = {k: float(v) for k, v in given.items() if v and k != "home"}
    options: dict[str, Any] = {k: v for k, v in numbers.items() if k in ("boot", "place")}
    options |= {"battery": int(numbers["battery"])} if "battery" in numbers else {}
    options |= {"home": away(*map(float, given["home"].split(",")))} if "home" in given else {}
    scene = Scene(
        kind,
        MISSIONS.get(flies),
        solution=planned(flies) if flies in PLANS else None,
        arm=flies not in (*PLANS, "watch"),
        lands=flies != "hovering",
        elsewhere="elsewhere" in given,
        parameters={name: value for name, value in numbers.items() if name.isupper()},
        **options,
    )
    if "stays-armed" in given:
        scene.mock.flight.aircraft.landed = lambda _: False
    if "unwell" in given:
        scene.mock._why_not_armed = lambda: "Compass not healthy"
    if "keeps-armed" in given:
        arm = scene.mock._arm
        scene.mock._arm = lambda wanted: arm(True) if wanted else 4
    if "not-flyable" in given:
        scene.mock._flyable = lambda: None
    if "refuses" in given:
        scene.loses(starts, denied=MavCommand.START)
    silences = list[tuple[float, float]]()
    for when, word, *words in map(str.split, filter(None, happens.split("; "))):
        begin, end = (float(each) for each in (when.split("-") * 2)[:2])
        if word == "silence":
            silences.append((begin, end))
        elif word in ("loses", "mutes"):
            scene.loses(PICKED[words[0]], begin, end, heard=word == "mutes")
        elif word in LENSES:
            scene.tells(LENSES[word](begin, end, *map(float, words)))
        elif word == "unready":
            scene.loses(PICKED["arm"], begin, end, denied=MavCommand.ARM)
        elif word in SPEAKERS:
            address, says = SPEAKERS[word]
            scene.others.append(Station(Script(speaks(begin, says)), address))
        else:
            scene.events.append((begin, scene._event(word, *words)))
    faults: dict[str, Any] = {k: v for k, v in numbers.items() if k in FAULTS}
    seed = int(faults.pop("seed", 0))
    scene.faults = Faults(**faults, seed=seed, outages=tuple(silences))
    scene.until = numbers.get("until", 300.0)
    return scene
