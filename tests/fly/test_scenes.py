"""Flights on the mock as scenes: what is watched, what happens, what becomes of it.

A line of `tests/data/fly/scenes.txt` has three parts between bars. The first names

- what is flown: `watch` (a mission that others start), `mission` (armed and started), `far` (one
  with a place 111 s away), `hovering` (one that ends in the air), or a plan by setpoints: `low`,
  `swift`, `fenced` and `away` (from where the vehicle stands), on `both` kinds or one;
- parameters NAME=VALUE; options of the mock, `home=EAST,HIGHER` in metres; faults of the link, of
  which `loss` may have several values; `until`, s;
- `refuses`: the start is denied; `stays-armed`: it does not disarm when it lands; `elsewhere`.

The second tells what happens at a time or in a time, s: somebody else sets a mode or gives an
order, packets are `silence`, some messages are lost (`loses`) or only their answers (`mutes`),
positions are changed. The third has the kind of the ending, "-" for none, and what holds then:
what was told (`says`), the ending's `text`, the gate's findings (`finds`), modes, orders;
`quiet`: nothing that moves it is sent from then on, `unmoved`: no setpoint.
"""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import (
    CHANGES,
    AnotherStation,
    Scene,
    arms,
    away,
    during,
    is_setpoint,
    low,
    starts,
    swift,
)
from scenes import under as with_plan
from simulate import Station
from stations import FOREIGN, HOME, RALLY, a_mission, rows_for, vehicle_of

from faao_mav.mission import Mission, MissionItem
from faao_mav.optimizer.solution import Solution
from faao_mav.sim.faults import Faults
from faao_mav.wire.messages import CommandAck, GlobalPositionInt, Message
from faao_mav.wire.protocol import GROUND_STATION, MavCommand, MissionType
from faao_mav.wire.wire_items import wire_items

SCENES = Path(__file__).parents[1] / "data" / "fly" / "scenes.txt"
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
FAULTS = ("loss", "seed", "reordering", "delay")
FAR = MissionItem(16, 3, x=HOME.latitude + 0.01, y=HOME.longitude, z=30.0)
MISSIONS = {
    "far": Mission((a_mission(3).items[0], FAR, MissionItem(20, 2)), HOME),
    "hovering": Mission(a_mission(12).items[:-1], HOME),
}
PLANS: dict[str, Callable[[], Solution]] = {
    "low": low,
    "swift": swift,
    "fenced": lambda: swift(fenced=True),
    "away": lambda: with_plan({"site.origin.latitude": HOME.latitude + 0.001}),
}
PICKED: dict[str, Callable[[Message], bool]] = {
    "arm": lambda message: arms(message, 1.0),
    "disarm": lambda message: arms(message, 0.0),
    "start": starts,
    "setpoints": is_setpoint,
    "land": lambda message: getattr(message, "param2", None) == MODES["ardupilot"]["land"],
}


def rows() -> Iterator[Any]:
    """Yield each scene, for each kind of autopilot and each loss that it names."""
    for line in SCENES.read_text().splitlines():
        if line and not line.startswith("#"):
            who, happens, becomes = (part.strip() for part in line.split("|"))
            flies, kinds, *given = who.split()
            settings = dict(word.partition("=")[::2] for word in given)
            for kind in ("ardupilot", "px4") if kinds == "both" else (kinds,):
                for loss in settings.get("loss", "0").split(","):
                    one = {**settings, "loss": loss}
                    yield pytest.param(flies, kind, one, happens, becomes, id=f"{kind} {line}")


class Stage:
    """One scene, as it is set up."""

    def __init__(self, flies: str, kind: str, given: dict[str, str], happens: str) -> None:
        self.kind, self.modes = kind, MODES[kind]
        self.events, self.others = list[tuple[float, Any]](), list[Station]()
        numbers = {k: float(v) for k, v in given.items() if v and k != "home"}
        options: dict[str, Any] = {k: v for k, v in numbers.items() if k in ("boot", "place")}
        options |= {"battery": int(numbers["battery"])} if "battery" in numbers else {}
        if "home" in given:
            options["home"] = away(*map(float, given["home"].split(",")))
        self.until = numbers.get("until", 300.0)
        self.scene = Scene(
            kind,
            MISSIONS.get(flies),
            solution=PLANS[flies]() if flies in PLANS else None,
            arm=flies not in (*PLANS, "watch"),
            lands=flies != "hovering",
            elsewhere="elsewhere" in given,
            parameters={name: value for name, value in numbers.items() if name.isupper()},
            **options,
        )
        if "stays-armed" in given:
            self.scene.mock.flight.aircraft.landed = lambda _: False
        if "refuses" in given:
            on, denial = self.scene.mock.on, CommandAck(GROUND_STATION, MavCommand.START, 4)
            self.scene.mock.on = lambda envelope, now: (
                [denial] if starts(envelope.message) else on(envelope, now)
            )
        silences = []
        for when, *words in map(str.split, filter(None, happens.split("; "))):
            begin, end = (float(each) for each in (when.split("-") * 2)[:2])
            if words == ["silence"]:
                silences.append((begin, end))
            elif words[0] in ("loses", "mutes"):
                self._loses(PICKED[words[1]], begin, end, heard=words[0] == "mutes")
            elif words[0] in CHANGES:
                changed = CHANGES[words[0]](*map(float, words[1:]))
                self.scene.tells(during(begin, end, changed))
            elif words == ["blind"]:
                self._blinds(begin)
            elif words[0] in ("station", "twin"):
                address = FOREIGN if words[0] == "station" else GROUND_STATION
                self.others.append(Station(AnotherStation(since=begin), address))
            else:
                self.events.append((begin, self._event(*words)))
        faults: dict[str, Any] = {k: v for k, v in numbers.items() if k in FAULTS}
        seed = int(faults.pop("seed", 0))
        self.faults = Faults(**faults, seed=seed, outages=tuple(silences))

    def _loses(
        self, picked: Callable[[Message], bool], begin: float, end: float, *, heard: bool
    ) -> None:
        self.scene.loses(lambda said, now: picked(said) and begin <= now < end, heard=heard)

    def _blinds(self, begin: float) -> None:
        self.scene.tells(
            lambda said, now: [said][isinstance(said, GlobalPositionInt) and now > begin :]
        )

    def _event(self, word: str, number: str = "0") -> Any:
        scene, mock = self.scene, self.scene.mock

        def change(part: MissionType, rows: Sequence[Any]) -> Callable[[float], object]:
            return lambda _: mock.lists.replace(part, rows)

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
            case "change":  # an item of its mission
                rows = list(mock.lists.items(MissionType.MISSION))
                rows[5] = rows_for(self.kind, 12, shift=1e-4)[5]
                return change(MissionType.MISSION, rows)
            case "rally":
                rally, part = a_mission(5, rally=RALLY), MissionType.RALLY
                return change(part, wire_items(rally, part, vehicle_of(self.kind)))
        return scene.does(*ORDERS[word]) if word in ORDERS else scene.sets(self.modes[word])

    def play(self, looks: Sequence[tuple[float, Callable[[float], object]]]) -> str:
        """Return the kind of the ending; `looks` are called at their times."""
        events = [*self.events, *looks]
        return self.scene.run(self.faults, self.until, events=events, others=self.others) or "-"


@pytest.mark.parametrize(("flies", "kind", "given", "happens", "becomes"), [*rows()])
def test_what_becomes_of_it(
    flies: str, kind: str, given: dict[str, str], happens: str, becomes: str
) -> None:
    stage = Stage(flies, kind, given, happens)
    scene, watch, mock = stage.scene, stage.scene.watch, stage.scene.mock
    ending, *wanted = becomes.split(" & ")
    seen: dict[str, Any] = {}
    looks: list[tuple[float, Callable[[float], object]]] = []

    def look(name: str, at: float, what: Callable[[], Any]) -> None:
        looks.append((at, lambda _: seen.__setitem__(name, what())))

    for each in wanted:
        first, *words = each.split()
        if first in ("quiet", "busy"):
            look(each, float(words[0]), lambda: len(scene.orders))
        elif words[:1] == ["mode"] and first[0].isdigit():
            look(each, float(first), lambda: mock.mode)
        elif words == ["disarmed"]:
            look(each, float(first), lambda: mock.armed)
    assert stage.play(looks) == ending
    outcome, said = watch.outcome, watch.seen.told
    for each in wanted:
        first, *words = each.split()
        rest = " ".join(words)
        match first:
            case "says":
                assert any(rest in text for text in said)
            case "not":
                assert not any(rest.removeprefix("says ") in text for text in said)
            case "once":
                assert sum(rest in text for text in said) == 1
            case "text":
                assert rest in outcome.text
            case "ends":
                assert outcome.text.endswith(rest)
            case "finds":
                told = [
                    f"{finding.rule} {finding.message} {finding.action}"
                    for finding in watch.findings
                ]
                assert any(rest in text for text in told)
            case "no":
                assert scene.orders == []
            case "orders" | "exactly":
                given_orders = scene.commands
                if first == "orders":
                    given_orders = list(dict.fromkeys(given_orders))
                assert given_orders == [ORDERS[word.lower()] for word in words]
            case "quiet":
                assert len(scene.orders) == seen[each]
            case "busy":
                assert len(scene.orders) > seen[each]
            case "unmoved":
                assert scene.after(*map(float, rest.split("-"))) == 0
            case "moved":
                assert scene.after(float(rest)) > 50
            case "level":
                late = np.array(scene.times) > float(rest)
                assert np.abs(np.array(scene.sent)[late, 2] - 6.0).max() < 0.2
            case "in":
                sent: list[Any] = [*filter(is_setpoint, scene.client.sent)]
                times = [each.time_boot_ms for each in sent]
                assert times == sorted(times)
            case "gated":
                scene.assert_gated(*map(float, words))
            case "arrived":
                scene.assert_arrived()
            case "heard":
                assert watch.seen.fixes[-1].t > float(rest)
            case "armed" | "disarmed":
                assert mock.armed == (first == "armed")
            case "end":
                assert mock.mode == stage.modes[words[1]]
            case _ if words[0] == "mode":
                assert seen[each] == stage.modes[words[1]]
            case _:
                assert words == ["disarmed"]
                assert seen[each] is False
