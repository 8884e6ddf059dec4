"""Flights on the mock that meet trouble at random, and what must not happen in any of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from random import Random
from typing import Any, get_args

import numpy as np
from conftest import FLYABLE, edited
from scenes import (
    CHANGES,
    LOITER,
    METRE,
    SWIFT,
    AnotherStation,
    Change,
    Scene,
    arms,
    during,
    harmless,
    low,
    swift,
)
from simulate import Station, simulate
from stations import FOREIGN, HOME, VEHICLE, Counted

from faao_mav import optimize, parse_plan
from faao_mav.fly.gate import LEVEL, NEAR
from faao_mav.fly.telemetry import Kind
from faao_mav.geodesy import LocalFrame
from faao_mav.mission import Home
from faao_mav.optimizer.solution import Solution
from faao_mav.sim.faults import Faults
from faao_mav.wire.machine import Machine
from faao_mav.wire.messages import (
    Envelope,
    GlobalPositionInt,
    Heartbeat,
    Message,
    SetPositionTargetLocalNed,
)
from faao_mav.wire.protocol import GROUND_STATION, Address, MavCommand

COMPANION = Address(1, 191)
LOST, PATIENCE = 400.0, 500.0
"""When the pilot lands what still flies, s, and when a flight without an end counts as one."""

ALLOWED = {0: "Position", 3: "Return", 4: "Land", 5: "Hold"}
"""Values of COM_OBL_RC_ACT with which PX4 may be flown by setpoints, of those that are tried."""


@cache
def waiting() -> Solution:
    """Return a plan of 50 s for the small flight, which hovers in the middle."""
    slow = {"flight.end": [50, 0], "flight.duration": 50, "radio.ground_user.position": [60, 60]}
    return optimize(parse_plan(edited(FLYABLE, SWIFT | slow)))


Event = tuple[float, Callable[[float], object]]


@dataclass
class Trial:
    """A flight, and the trouble that it meets: all of it follows from `seed`."""

    seed: int
    kind: str = "px4"
    streams: bool = True
    fenced: bool = False
    faults: Faults = field(default_factory=Faults)
    parameters: dict[str, float] = field(default_factory=dict)
    moved: float = 0.0
    """How far the vehicle stands from where the flight begins, m."""

    incidents: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, seed: int) -> "Trial":
        """Return the trial of that number."""
        random = Random(f"campaign {seed}")
        begins = [random.uniform(0.0, 95.0) for _ in range(random.choice((0, 1, 1, 2, 2)))]
        outages = tuple((begin, begin + random.expovariate(1 / 12)) for begin in begins)
        faults = Faults(
            loss=random.choice((0.0, 0.0, 0.0, 0.05, 0.2, 0.4)),
            duplication=random.choice((0.0, 0.1)),
            reordering=random.choice((0.0, 0.1)),
            delay=random.uniform(0.0, 0.4),
            latency=random.uniform(0.002, 0.2),
            outages=outages,
            seed=seed,
        )
        known = ["pilot", "home", "reboot", "companion", "station", "glitch", "stuck", "leap"]
        return cls(
            seed,
            kind=random.choice(("ardupilot", "px4")),
            streams=random.random() < 0.75,
            fenced=random.random() < 0.5,
            faults=faults,
            parameters={
                "GUID_TIMEOUT": random.choice((*(1.0,) * 8, 0.5, 3.0)),
                "COM_OBL_RC_ACT": random.choice((0.0, *(3.0, 4.0, 5.0) * 4, 6.0, 7.0)),
            },
            moved=random.choice((*(0.0,) * 9, random.uniform(60.0, 2000.0))),
            incidents=random.sample([*known, "interrupt"], random.choice((0, 1, 1, 2))),
        )

    @property
    def may_start(self) -> bool:
        """Whether it may be armed."""
        if not self.streams:
            return self.moved == 0.0
        known = self.parameters["COM_OBL_RC_ACT"] in ALLOWED
        stops = self.parameters["GUID_TIMEOUT"] <= 1.0
        return self.moved == 0.0 and (known if self.kind == "px4" else stops)

    @property
    def solution(self) -> Solution | None:
        """What is flown by setpoints, None for a mission."""
        if not self.streams:
            return None
        plans = (low, waiting, lambda: swift(fenced=self.fenced))
        return plans[self.seed % 3]()


@dataclass
class Judged:
    """How a trial went: how it ended, and what must not have happened."""

    trial: Trial
    ending: str
    text: str
    wrong: list[str]
    setpoints: int


class Judge(Counted):
    """A watch whose every message is judged as it is sent."""

    def __init__(self, watch: Any, trial: Trial, home: Home) -> None:
        super().__init__(watch)
        self.trial, self.home = trial, home
        self.wrong: list[str] = []
        self.setpoints = 0
        self._told: GlobalPositionInt | None = None
        self._mode: int | None = None
        self._ordered, self._ordered_at, self._pilots = False, 0.0, False

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        if envelope.sender == VEHICLE:
            self._hear(envelope.message)
        return self._judged(super().on(envelope, now), now)

    def tick(self, now: float) -> Sequence[Message]:
        sent = self._judged(super().tick(now), now)
        watch = self.machine
        asks = watch.phase == "holding" and watch._order is not None and watch.outcome is None
        unsure = self.trial.streams and watch._unsure_since is not None
        if asks and not unsure and now > self._ordered_at + 2.1:
            self.wrong.append(f"{now:.1f} s: the hold is not asked for any more")
        return sent

    def _hear(self, message: Message) -> None:
        match message:
            case GlobalPositionInt(time_boot_ms=t):
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
            self._ordered, self._ordered_at = True, now
            if arms(message, 1.0) and not self.trial.may_start:
                self.wrong.append(f"{now:.1f} s: armed")
            if self._pilots:
                self.wrong.append(f"{now:.1f} s: {type(message).__name__} to what a pilot has")
            if isinstance(message, SetPositionTargetLocalNed):
                self.setpoints += 1
                self._measure(message, now)
        return sent

    def _measure(self, setpoint: SetPositionTargetLocalNed, now: float) -> None:
        """Compare where it is sent with where it said that it is."""
        solution, told = self.trial.solution, self._told
        assert solution is not None
        assert told is not None
        plan = solution.plan
        own = self.machine._family.local_frame(self.home.latitude, self.home.longitude)
        plans = LocalFrame(plan.origin.latitude, plan.origin.longitude)
        to = plans.to_local(*own.to_geodetic([setpoint.y, setpoint.x]))
        place = plans.to_local(told.lat / 1e7, told.lon / 1e7)
        up = self.home.altitude - setpoint.z - told.alt / 1000
        across, speed = float(np.hypot(*(to - place))), plan.max_ground_speed
        faults = self.trial.faults
        lead = min(2 * (faults.latency + faults.delay), 1.0) + 0.05
        cap = NEAR + speed**2 / (2 * plan.vehicle.max_acceleration) + speed * lead
        if across > cap or abs(up) > LEVEL + 2.0 + speed * lead:
            self.wrong.append(f"{now:.1f} s: sent {across:.1f} m away, {up:+.1f} m up")
        far, straight = across > NEAR + speed * lead, np.array([place, to])
        if far and plan.keep_in is not None and not plan.keep_in.covers_path(straight):
            self.wrong.append(f"{now:.1f} s: sent across the fence, {across:.1f} m")


class Companion(Machine[None]):
    """A computer on board that tells a place and a mode of its own."""

    progress = ("being there", 0, 0)

    def start(self, now: float) -> Sequence[Message]:
        self._due = now
        return ()

    def _receive(self, *_: object) -> Sequence[Message]:
        return ()

    def _time_out(self, now: float) -> Sequence[Message]:
        self._due = now + 0.3
        ms, place = round(now * 1000) + 5000, (round(HOME.latitude * 1e7), round(1e9), 9000, 9000)
        return [Heartbeat(18, 8, 0, LOITER, 4), GlobalPositionInt(ms, *place, 0, 0, 0, 0)]


def flown(trial: Trial) -> Judged:
    """Fly it."""
    random = Random(f"incidents {trial.seed}")
    home = replace(HOME, latitude=HOME.latitude + trial.moved * METRE / 1e7)
    scene = Scene(
        trial.kind,
        solution=trial.solution,
        home=home,
        parameters=trial.parameters,
        arm=not trial.streams,
    )
    judge = Judge(scene.watch, trial, home)
    scene.client = judge
    others: list[Station] = []
    events: list[Event] = [
        (LOST, scene.sets(LOITER)),
        (LOST + 5.0, scene.does(MavCommand.ARM, 0)),
        *((LOST + wait, interrupt(judge)) for wait in (20.0, 30.0)),
    ]
    for name in trial.incidents:
        happens(name, scene, judge, random, events, others)
    stations = Station(judge, GROUND_STATION), Station(scene.mock, VEHICLE)
    simulate(*stations, trial.faults, PATIENCE, others=others, events=events)
    outcome = judge.outcome
    if outcome is None or outcome.kind not in get_args(Kind) or not outcome.text:
        judge.wrong.append(f"no end, or one without a name: {outcome}")
    kind, text = ("", "") if outcome is None else (outcome.kind, outcome.text)
    return Judged(trial, kind, text, judge.wrong, judge.setpoints)


def interrupt(judge: Judge) -> Callable[[float], None]:
    """Return an event: Ctrl-C, of which the first order is lost."""

    def cancelled(now: float) -> None:
        if judge.outcome is None:
            judge.sent += judge.cancel(now)
            judge._ordered_at = now

    return cancelled


def happens(
    name: str,
    scene: Scene,
    judge: Judge,
    random: Random,
    events: list[Event],
    others: list[Station],
) -> None:
    """Let one incident happen, as `random` draws it."""
    match name:
        case "pilot":  # takes it, may set the mode back, and lands it
            begin, modes = random.uniform(8.0, 100.0), scene.watch._modes
            events.append((begin, scene.sets(LOITER)))
            if random.random() < 0.5:
                mission = modes.guided is None or random.random() < 0.5
                back = modes.mission if mission else modes.guided
                events.append((begin + random.uniform(0.5, 20.0), scene.sets(back)))
            events.append((begin + 60.0, scene.does(MavCommand.ARM, 0)))
        case "reboot":
            events.append((random.uniform(5.0, 100.0), scene.mock.reboot))
        case "interrupt":  # also while the link is silent, and perhaps a second one
            silent = [begin + 0.5 for begin, _ in judge.trial.faults.outages]
            begin = random.choice([random.uniform(1.0, 100.0), *silent])
            events.append((begin, interrupt(judge)))
            if random.random() < 0.5:
                events.append((begin + random.uniform(0.5, 60.0), interrupt(judge)))
        case "companion":
            others.append(Station(Companion(), COMPANION))
        case "station":
            since = random.choice((0.0, 30.0, 50.0))
            others.append(Station(AnotherStation(since=since), FOREIGN))
        case _:  # other positions are told, for a while or for good
            begin, changed = random.uniform(20.0, 100.0), change(name, random)
            scene.tells(during(begin, begin + random.choice((2.0, 15.0, 1e9)), changed))


def change(name: str, random: Random) -> Change:
    """Return what becomes of positions: home moves, the place jumps, stands, or the clock leaps."""
    match name:
        case "home":
            return CHANGES["higher"](random.choice((-100, -5, 5, 100)))
        case "glitch":
            return CHANGES["jump"](random.choice((20.0, 100.0, 1000.0)))
        case "leap":
            return CHANGES["leap"](random.choice((-60, -1, 1, 20, 1_000)))
    return CHANGES["stuck"]()
