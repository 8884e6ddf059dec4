"""A scene of the mock as a row of words sets it up: see `test_scenes.py` for the words."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from scenes import (
    CHANGES,
    AnotherStation,
    Companion,
    Scene,
    arms,
    away,
    during,
    is_setpoint,
    low,
    starts,
    swift,
    waiting,
)
from scenes import under as with_plan
from simulate import Station
from stations import FOREIGN, HOME, RALLY, a_mission, rows_for, vehicle_of

from faao_mav.mission import Mission, MissionItem
from faao_mav.optimizer.solution import Solution
from faao_mav.sim.faults import Faults
from faao_mav.wire.messages import (
    CommandAck,
    CommandLong,
    Envelope,
    GlobalPositionInt,
    Message,
    MissionCurrent,
)
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
PLANS: dict[str, Callable[[], Solution]] = {
    "low": low,
    "swift": swift,
    "fenced": lambda: swift(fenced=True),
    "waiting": waiting,
    "hovers": lambda: with_plan({"mission.on_finish": "hover"}),
    "away": lambda: with_plan({"site.origin.latitude": HOME.latitude + 0.001}),
}
PICKED: dict[str, Callable[[Message], bool]] = {
    "arm": lambda message: arms(message, 1.0),
    "disarm": lambda message: arms(message, 0.0),
    "start": starts,
    "setpoints": is_setpoint,
    "hold": lambda message: (
        isinstance(message, CommandLong)
        and message.command == MavCommand.SET_MODE
        and (message.param2, message.param3) in ((MODES["ardupilot"]["hold"], 0), (4, 3))
    ),
    "land": lambda message: getattr(message, "param2", None) == MODES["ardupilot"]["land"],
}


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
            self._denies(starts, MavCommand.START)
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
            elif words == ["hold-up"]:
                self._holds_up(begin, end)
            elif words == ["lag"]:
                self._lags()
            elif words == ["unready"]:
                self._denies(PICKED["arm"], MavCommand.ARM, end)
            elif words[0] in ("station", "twin", "companion"):
                address = {"station": FOREIGN, "companion": Address(1, 191)}.get(
                    words[0], GROUND_STATION
                )
                other = Companion if words[0] == "companion" else AnotherStation
                self.others.append(Station(other(begin), address))
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

    def _holds_up(self, begin: float, end: float) -> None:
        """Hold back all that the vehicle says, and then deliver it at once."""
        held = list[Message]()

        def bursts(said: Message, now: float) -> Sequence[Message]:
            if begin <= now < end:
                held.append(said)
                return ()
            out = [*held, said]
            held.clear()
            return out

        self.scene.tells(bursts)

    def _lags(self) -> None:
        """Tell the item under way a message later, which is a second."""
        told: list[Message] = []

        def late(said: Message, _: float) -> Sequence[Message]:
            if isinstance(said, MissionCurrent):
                told.append(said)
                return told[-2:-1] or [said]
            return [said]

        self.scene.tells(late)

    def _denies(
        self, picked: Callable[[Message], bool], command: int, until: float = math.inf
    ) -> None:
        on, denial = self.scene.mock.on, CommandAck(GROUND_STATION, command, 4)

        def hear(envelope: Envelope, now: float) -> Sequence[Message]:
            denied = picked(envelope.message) and now < until
            answers: Sequence[Message] = [denial] if denied else on(envelope, now)
            return answers

        self.scene.mock.on = hear

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
            case "shorten":
                rows = mock.lists.items(MissionType.MISSION)[:-2]
                return change(MissionType.MISSION, rows)
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
