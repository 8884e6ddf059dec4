"""Flights on the mock that meet trouble at random, and what must not happen in any of them."""

from random import Random
from typing import Any, get_args

from scenes import PLANS, staged

from faao_mav.fly.telemetry import Kind

_END = "400 loiter; 405 disarm; 420 interrupt; 430 interrupt"
"""What still flies then the pilot lands, and it is left."""

_SAFE = {"GUID_TIMEOUT": (0.5, 1), "COM_OBL_RC_ACT": (0, 3, 4, 5)}
"""Parameters with which an autopilot is flown by setpoints."""


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


def flown(seed: int) -> list[str]:
    """Fly what `seed` draws, in the words of scenes; return what must not happen and did."""
    random = Random(f"campaign {seed}")
    flies = random.choice(("mission", *("low", "waiting", "swift", "fenced") * 2))
    begins = [random.uniform(0.0, 95.0) for _ in range(random.choice((0, 1, 1, 2, 2)))]
    happens = [f"{x:.2f}-{x + random.expovariate(1 / 12):.2f} silence" for x in begins]
    for name in random.sample(list(_INCIDENTS), random.choice((0, 1, 1, 2))):
        happens += _INCIDENTS[name](random, begins)
    moved = random.choice((*(0.0,) * 9, random.uniform(60.0, 2000.0)))
    numbers = {
        "seed": seed,
        "loss": random.choice((0.0, 0.0, 0.0, 0.05, 0.2, 0.4)),
        "duplication": random.choice((0.0, 0.1)),
        "reordering": random.choice((0.0, 0.1)),
        "delay": random.uniform(0.0, 0.4),
        "latency": random.uniform(0.002, 0.2),
        "GUID_TIMEOUT": random.choice((*(1,) * 8, 0.5, 3)),
        "COM_OBL_RC_ACT": random.choice((0, *(3, 4, 5) * 4, 6, 7)),
        "until": 500,
    }
    given = {name: f"{value}" for name, value in numbers.items()}
    given |= {"home": f"{moved:.0f}"} if moved else {}
    kind = random.choice(("ardupilot", "px4"))
    scene = staged(flies, kind, given, "; ".join([*happens, _END]))
    own = "GUID_TIMEOUT" if kind == "ardupilot" else "COM_OBL_RC_ACT"
    scene.client.may_start = not moved and (flies not in PLANS or numbers[own] in _SAFE[own])
    scene.run()
    outcome = scene.watch.outcome
    if outcome is None or outcome.kind not in get_args(Kind) or not outcome.text:
        scene.client.wrong.append(f"no end, or one without a name: {outcome}")
    return scene.client.wrong
