"""Flights on the mock that meet trouble at random, and what must not happen in any of them.

A trial is a scene as `stages.py` sets it up, drawn from its seed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from random import Random
from typing import Any, get_args

import numpy as np
from scenes import LOITER, PLANS, Scene, arms, harmless
from stages import staged
from stations import VEHICLE, Counted

from faao_mav.fly.itinerary import LEVEL, NEAR
from faao_mav.fly.telemetry import Kind
from faao_mav.geodesy import LocalFrame
from faao_mav.wire import messages
from faao_mav.wire.messages import Envelope, Message

_END = "400 loiter; 405 disarm; 420 interrupt; 430 interrupt"
"""What still flies then the pilot lands, and it is left."""

_UNSAFE = {"COM_OBL_RC_ACT=6", "COM_OBL_RC_ACT=7", "GUID_TIMEOUT=3"}
"""Parameters with which an autopilot is not flown by setpoints."""


@dataclass(frozen=True)
class Trial:
    """A flight, and the trouble that it meets, in the words of scenes: all follows from `seed`."""

    seed: int
    flies: str
    kind: str
    given: tuple[str, ...]
    happens: str

    @classmethod
    def of(cls, seed: int) -> "Trial":
        """Return the trial of that number."""
        random = Random(f"campaign {seed}")
        flies = random.choice(("mission", *("low", "waiting", "swift", "fenced") * 2))
        begins = [random.uniform(0.0, 95.0) for _ in range(random.choice((0, 1, 1, 2, 2)))]
        happens = [f"{x:.2f}-{x + random.expovariate(1 / 12):.2f} silence" for x in begins]
        for name in random.sample(list(_INCIDENTS), random.choice((0, 1, 1, 2))):
            happens += _INCIDENTS[name](random, begins)
        moved = random.choice((*(0.0,) * 9, random.uniform(60.0, 2000.0)))
        given = (
            f"seed={seed}",
            f"loss={random.choice((0.0, 0.0, 0.0, 0.05, 0.2, 0.4))}",
            f"duplication={random.choice((0.0, 0.1))}",
            f"reordering={random.choice((0.0, 0.1))}",
            f"delay={random.uniform(0.0, 0.4):.3f}",
            f"latency={random.uniform(0.002, 0.2):.3f}",
            f"GUID_TIMEOUT={random.choice((*(1,) * 8, 0.5, 3))}",
            f"COM_OBL_RC_ACT={random.choice((0, *(3, 4, 5) * 4, 6, 7))}",
            *([f"home={moved:.0f}"] if moved else []),
            "until=500",
        )
        happens.append(_END)
        return cls(seed, flies, random.choice(("ardupilot", "px4")), given, "; ".join(happens))

    @property
    def may_start(self) -> bool:
        """Whether it may be armed."""
        own = {"ardupilot": "GUID", "px4": "COM"}[self.kind]
        unsafe = [each for each in _UNSAFE & {*self.given} if each.startswith(own)]
        here = not any(each.startswith("home") for each in self.given)
        return here and not (unsafe and self.flies in PLANS)

    def __str__(self) -> str:
        return f"{self.flies} {self.kind} {' '.join(self.given)} | {self.happens}"


def _pilot(random: Random, _: list[float]) -> list[str]:
    """Take it, perhaps set the mode back, and land it."""
    begin = random.uniform(8.0, 100.0)
    back = f"{begin + random.uniform(0.5, 20.0):.2f} {random.choice(('mission', 'guided'))}"
    backs = [back] if random.random() < 0.5 else []
    return [f"{begin:.2f} loiter", *backs, f"{begin + 60:.2f} disarm"]


def _interrupt(random: Random, silences: list[float]) -> list[str]:
    """Interrupt it, also while the link is silent, and perhaps a second time."""
    begin = random.choice([random.uniform(1.0, 100.0), *(each + 0.5 for each in silences)])
    again = begin + random.uniform(0.5, 60.0)
    return [f"{begin:.2f} interrupt", *[f"{again:.2f} interrupt"] * (random.random() < 0.5)]


def _told(word: str, *values: float) -> Any:
    """Return an incident: other positions are told, for a while or for good."""

    def happens(random: Random, _: list[float]) -> list[str]:
        begin, value = random.uniform(20.0, 100.0), str(random.choice(values)) if values else ""
        return [f"{begin:.2f}-{begin + random.choice((2.0, 15.0, 1e9)):.2f} {word} {value}"]

    return happens


_INCIDENTS: dict[str, Any] = {
    "pilot": _pilot,
    "interrupt": _interrupt,
    "reboot": lambda random, _: [f"{random.uniform(5.0, 100.0):.2f} reboot"],
    "companion": lambda *_: ["0 companion"],
    "station": lambda random, _: [f"{random.choice((0.0, 30.0, 50.0))} station"],
    "home": _told("higher", -100, -5, 5, 100),
    "glitch": _told("jump", 20, 100, 1000),
    "stuck": _told("stuck"),
    "leap": _told("leap", -60, -1, 1, 20, 1000),
}


class Judge(Counted):
    """A watch whose every message is judged as it is sent: `wrong` is what must not happen."""

    def __init__(self, trial: Trial, scene: Scene) -> None:
        super().__init__(scene.watch)
        self.trial, self.home, self.faults = trial, scene.mock.home, scene.faults
        self.solution = scene.solution
        self.wrong: list[str] = []
        self.setpoints = 0
        self._told: messages.GlobalPositionInt | None = None
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
        unsure = watch.streams and watch._unsure_since is not None
        if asks and not unsure and now > self._ordered_at + 2.1:
            self.wrong.append(f"{now:.1f} s: the hold is not asked for any more")
        return sent

    def cancel(self, now: float) -> Sequence[Message]:
        if self.machine.outcome is not None:
            return ()
        self._ordered_at = now
        sent: Sequence[Message] = self.machine.cancel(now)
        return sent

    def _hear(self, message: Message) -> None:
        match message:
            case messages.GlobalPositionInt(time_boot_ms=t):
                if self._told is None or t > self._told.time_boot_ms:
                    self._told = message
            case messages.Heartbeat(custom_mode=mode):
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
            if isinstance(message, messages.SetPositionTargetLocalNed):
                self.setpoints += 1
                self._measure(message, now)
        return sent

    def _measure(self, setpoint: messages.SetPositionTargetLocalNed, now: float) -> None:
        """Compare where it is sent with where it said that it is."""
        told = self._told
        assert self.solution is not None
        assert told is not None
        plan, faults = self.solution.plan, self.faults
        own = self.machine._family.local_frame(self.home.latitude, self.home.longitude)
        plans = LocalFrame(plan.origin.latitude, plan.origin.longitude)
        to = plans.to_local(*own.to_geodetic([setpoint.y, setpoint.x]))
        place = plans.to_local(told.lat / 1e7, told.lon / 1e7)
        up = self.home.altitude - setpoint.z - told.alt / 1000
        across, speed = float(np.hypot(*(to - place))), plan.max_ground_speed
        lead = min(2 * (faults.latency + faults.delay), 1.0) + 0.05
        cap = NEAR + speed**2 / (2 * plan.vehicle.max_acceleration) + speed * lead
        if across > cap or abs(up) > LEVEL + 2.0 + speed * lead:
            self.wrong.append(f"{now:.1f} s: sent {across:.1f} m away, {up:+.1f} m up")
        far, straight = across > NEAR + speed * lead, np.array([place, to])
        if far and plan.keep_in is not None and not plan.keep_in.covers_path(straight):
            self.wrong.append(f"{now:.1f} s: sent across the fence, {across:.1f} m")


def flown(trial: Trial) -> Judge:
    """Fly it, and return what it is judged by."""
    given = dict(word.partition("=")[::2] for word in trial.given)
    scene = staged(trial.flies, trial.kind, given, trial.happens)
    judge = scene.client = Judge(trial, scene)
    scene.run()
    outcome = judge.outcome
    if outcome is None or outcome.kind not in get_args(Kind) or not outcome.text:
        judge.wrong.append(f"no end, or one without a name: {outcome}")
    return judge
