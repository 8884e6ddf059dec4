"""Flights on the mock that meet trouble at random, and what must not happen in any of them.

A trial is a scene as `scenes.py` sets it up, drawn from its seed.
"""

from dataclasses import dataclass
from random import Random
from typing import Any, get_args

from scenes import PLANS, Judge, staged

from faao_mav.fly.telemetry import Kind

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


def flown(trial: Trial) -> Judge:
    """Fly it, and return what it is judged by."""
    given = dict(word.partition("=")[::2] for word in trial.given)
    scene = staged(trial.flies, trial.kind, given, trial.happens)
    scene.client.may_start = trial.may_start
    scene.run()
    outcome = scene.watch.outcome
    if outcome is None or outcome.kind not in get_args(Kind) or not outcome.text:
        scene.client.wrong.append(f"no end, or one without a name: {outcome}")
    return scene.client
