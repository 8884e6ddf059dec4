"""A scene of the mock as a row of words sets it up: see `test_scenes.py` for the words."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

from scenes import (
    METRE,
    PLANS,
    AnotherStation,
    Companion,
    Lens,
    Scene,
    arms,
    away,
    is_setpoint,
    planned,
    starts,
)
from simulate import Station
from stations import FOREIGN, HOME, RALLY, a_mission, rows_for, vehicle_of

from faao_mav.mission import Mission, MissionItem
from faao_mav.sim.faults import Faults
from faao_mav.wire import messages
from faao_mav.wire.messages import Envelope, Message
from faao_mav.wire.protocol import GROUND_STATION, Address, MavCommand, MissionType
from faao_mav.wire.wire_items import wire_items

MODES: dict[str, dict[str, int]] = {
    "ardupilot": {"mission": 3, "guided": 4, "loiter": 5, "return": 6, "land": 9, "hold": 17},
    "px4": {
        "loiter": 5,
        "guided": 6 << 16,
        **{name: 4 << 16 | n << 24 for n, name in ((3, "hold"), (4, "mission"), (5, "return"))},
        "land": 4 << 16 | 6 << 24,
    },
}
ORDERS: dict[str, tuple[int, float]] = {
    "arm": (MavCommand.ARM, 1.0),
    "disarm": (MavCommand.ARM, 0.0),
    "start": (MavCommand.START, 0.0),
}
SPEAKERS = {"station": FOREIGN, "twin": GROUND_STATION, "companion": Address(1, 191)}
FAULTS = ("loss", "seed", "reordering", "delay", "duplication", "latency")
FAR = MissionItem(16, 3, x=HOME.latitude + 0.01, y=HOME.longitude, z=30.0)
MISSIONS = {
    "far": Mission((a_mission(3).items[0], FAR, MissionItem(20, 2)), HOME),
    "hovering": Mission(a_mission(12).items[:-1], HOME),
}
Picks: TypeAlias = Callable[[Message], bool]
PICKED: dict[str, Picks] = {
    "arm": lambda message: arms(message, 1.0),
    "disarm": lambda message: arms(message, 0.0),
    "start": starts,
    "setpoints": is_setpoint,
    "hold": lambda message: (
        isinstance(message, messages.CommandLong)
        and message.command == MavCommand.SET_MODE
        and (message.param2, message.param3) in ((MODES["ardupilot"]["hold"], 0), (4, 3))
    ),
    "land": lambda message: getattr(message, "param2", None) == MODES["ardupilot"]["land"],
}


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


LENSES: dict[str, Callable[..., Lens]] = {
    "blind": blind,
    "hold-up": hold_up,
    "lag": lag,
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
    if "refuses" in given:
        denies(scene, starts, MavCommand.START)
    silences = list[tuple[float, float]]()
    for when, word, *words in map(str.split, filter(None, happens.split("; "))):
        begin, end = (float(each) for each in (when.split("-") * 2)[:2])
        if word == "silence":
            silences.append((begin, end))
        elif word in ("loses", "mutes"):
            loses(scene, PICKED[words[0]], begin, end, heard=word == "mutes")
        elif word in LENSES:
            scene.tells(LENSES[word](begin, end, *map(float, words)))
        elif word == "unready":
            denies(scene, PICKED["arm"], MavCommand.ARM, end)
        elif word in SPEAKERS:
            other = Companion if word == "companion" else AnotherStation
            scene.others.append(Station(other(begin), SPEAKERS[word]))
        else:
            scene.events.append((begin, event(scene, kind, word, *words)))
    faults: dict[str, Any] = {k: v for k, v in numbers.items() if k in FAULTS}
    seed = int(faults.pop("seed", 0))
    scene.faults = Faults(**faults, seed=seed, outages=tuple(silences))
    scene.until = numbers.get("until", 300.0)
    return scene


def loses(scene: Scene, picked: Picks, begin: float, end: float, *, heard: bool) -> None:
    scene.loses(lambda said, now: picked(said) and begin <= now < end, heard=heard)


def denies(scene: Scene, picked: Picks, command: int, until: float = math.inf) -> None:
    on, denial = scene.mock.on, messages.CommandAck(GROUND_STATION, command, 4)

    def hear(envelope: Envelope, now: float) -> Sequence[Message]:
        denied = picked(envelope.message) and now < until
        answers: Sequence[Message] = [denial] if denied else on(envelope, now)
        return answers

    scene.mock.on = hear


def event(scene: Scene, kind: str, word: str, number: str = "0") -> Any:
    """Return what happens at a time: it is called with that."""
    mock, part = scene.mock, MissionType.MISSION
    rows = list(mock.lists.items(part))
    match word:
        case "interrupt":
            return scene.interrupt
        case "hang-up":
            return scene.hang_up
        case "reboot":
            return lambda now: mock.reboot(now)
        case "carried":
            return lambda _: setattr(mock, "home", away(60.0))
        case "current":
            return scene.does(MavCommand.SET_CURRENT, float(number))
        case "shorten":
            rows = rows[:-2]
        case "change":  # an item of its mission
            rows[5] = rows_for(kind, 12, shift=1e-4)[5]
        case "rally":
            part = MissionType.RALLY
            rows = list(wire_items(a_mission(5, rally=RALLY), part, vehicle_of(kind)))
        case _:
            return scene.does(*ORDERS[word]) if word in ORDERS else scene.sets(MODES[kind][word])
    return lambda _: mock.lists.replace(part, rows)
