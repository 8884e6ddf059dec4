"""A mock autopilot and a watch of it, on a simulated link."""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any, TypeAlias, cast

import numpy as np
from conftest import FLYABLE, edited
from simulate import Station, simulate
from stations import FOREIGN, HOME, VEHICLE, Counted, a_mission, peer_of, vehicle_of

from faao_mav import optimize, parse_plan
from faao_mav.arrays import Real
from faao_mav.autopilot import Track, Vehicle
from faao_mav.fly.itinerary import LEVEL, NEAR
from faao_mav.fly.preflight import Clearance, Flight
from faao_mav.fly.stream import Stream
from faao_mav.fly.telemetry import Held
from faao_mav.fly.watch import Watch
from faao_mav.geodesy import LocalFrame
from faao_mav.mission import Home, Mission
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.solution import Solution
from faao_mav.sim import MockAutopilot, MockKind, behaviour_of
from faao_mav.sim.faults import Faults
from faao_mav.wire import messages, protocol
from faao_mav.wire.machine import Machine
from faao_mav.wire.messages import CommandLong, Envelope, Heartbeat, Message
from faao_mav.wire.parameters import Reading
from faao_mav.wire.protocol import GROUND_STATION, MavCommand, MissionType
from faao_mav.wire.wire_items import wire_items

METRE = 1e7 / 111_319.5
"""A metre of latitude in 1e-7 degrees."""

LOITER = 5
"""A pilot's mode, of ArduCopter: PX4 knows no such number, and the mock takes any."""

ZONE = {
    "margin": 3,
    "inclusion": [[-40, -60], [260, -60], [260, 120], [-40, 120]],
    "exclusion": [{"polygon": [[80, -10], [120, -10], [120, 40], [80, 40]]}],
}
"""A fence with a zone across the straight of that flight."""

CAP = NEAR + 8**2 / (2 * 1.6)
"""The farthest, m, that the gate lets that flight be sent."""

RESTS = {
    "flight.start_velocity": "hover",
    "flight.end_velocity": "hover",
    "mission.on_finish": "land",
}
LOW: dict[str, Any] = RESTS | {
    "flight.altitude": 6,
    "flight.duration": 16,
    "vehicle.max_speed": 6,
    "vehicle.max_acceleration": 2.5,
}
SWIFT: dict[str, Any] = RESTS | {
    "flight.start": [0, 50],
    "flight.end": [200, 0],
    "flight.altitude": 30,
    "flight.duration": 32,
    "vehicle.max_speed": 8,
    "vehicle.max_acceleration": 1.6,
    "radio.ground_user.position": [220, 60],
}
SHORT = {"flight.end": [50, 0], "flight.duration": 50, "radio.ground_user.position": [60, 60]}
PLANS: dict[str, dict[str, Any]] = {
    "low": LOW,
    "hovers": LOW | {"mission.on_finish": "hover"},
    "away": LOW | {"site.origin.latitude": HOME.latitude + 0.001},
    "swift": SWIFT,
    "fenced": SWIFT | {"fence": ZONE, "flight.duration": 36},
    "waiting": SWIFT | SHORT,
}
"""Flights by setpoints: a low one of 16 s at up to 6 m/s, which may hover at its end, or begin away
from where the vehicle stands; a swift one, which flies 8 m/s for most of 206 m, with a zone across
its straight or without; and one that waits in the middle."""


@cache
def planned(flight: str) -> Solution:
    return optimize(parse_plan(edited(FLYABLE, PLANS[flight])))


def under(changes: dict[str, Any]) -> Solution:
    """Return the low flight for a plan that has what does not change it otherwise."""
    plan = parse_plan(edited(FLYABLE, LOW | changes))
    return replace(planned("low"), problem=build_problem(plan))


def away(metres: float, higher: float = 0.0) -> Home:
    """Return a place so many metres east of home."""
    frame = LocalFrame(HOME.latitude, HOME.longitude)
    latitude, longitude = frame.to_geodetic([metres, 0.0])
    return Home(float(latitude), float(longitude), HOME.altitude + higher)


def fly(mission: Mission, _: Vehicle | None = None) -> Track:
    """Return a flight from home over all places at 10 m/s; landing where it started."""
    assert mission.home is not None
    frame = LocalFrame(mission.home.latitude, mission.home.longitude)
    points, items = [np.zeros(3)], [0]
    for index, item in enumerate(mission.items):
        if item.command in (20, 21):
            points += [points[0] + [0, 0, points[-1][2]], points[0]]
            items += [index, index]
        elif item.frame == 3 or item.frame == 6:
            points.append(np.append(frame.to_local(item.x, item.y), item.z))
            items.append(index)
    legs = [np.linalg.norm(b - a) / 10.0 for a, b in pairwise(points)]
    times = np.concatenate([[0.0], np.cumsum(legs)])
    t = np.linspace(0.0, times[-1], int(times[-1] * 10) + 2)
    position = np.column_stack([np.interp(t, times, np.array(points)[:, k]) for k in range(3)])
    velocity = np.gradient(position, t, axis=0)
    following = np.searchsorted(times[1:], t, side="left").clip(max=len(legs) - 1)
    reached = np.full(len(mission.items), math.nan)
    for index, time in zip(items[1:], times[1:], strict=True):
        reached[index] = time
    return Track(t, position, velocity, np.array(items[1:])[following], reached, frame)


def held_by(mock: MockAutopilot, untold: Collection[str] = ()) -> Held:
    """Return what `mock` holds, as if it had been read, without the parameters `untold`."""
    values = mock.parameters.values.items()
    told = {name: value for name, value in values if name not in untold}
    lists = {part: mock.lists.items(part) for part in MissionType}
    return Held(lists, Reading(told), home=mock.home)


Heard: TypeAlias = Callable[[Any, float], object]
Lens: TypeAlias = Callable[[Message, float], Sequence[Message]]


class Scene:
    """A mock autopilot that holds a mission, and a watch of it on a simulated link.

    `flight` is what is asked for beside that mission, for which the mock may not be ready. With a
    `solution` it is flown by setpoints: `times`, s, are when the flying mock was sent one, `sent`
    where to and `places` where it was, m. `events` happen at their times, with `others` on the
    link, which has `faults`.
    """

    def __init__(
        self,
        kind: str,
        mission: Mission | None = None,
        *,
        arm: bool = False,
        lands: bool = True,
        solution: Solution | None = None,
        flight: Flight | None = None,
        elsewhere: bool = False,
        untimed: bool = False,
        **options: Any,
    ) -> None:
        mission = mission or a_mission(12)
        if solution is not None:
            options["parameters"] = {"GUID_TIMEOUT": 1.0, **options.get("parameters", {})}
        behaviour = behaviour_of(cast(MockKind, kind))
        self.mock: Any = MockAutopilot(behaviour, **{"home": HOME, **options})
        self.mock.flight._fly = fly
        for part in MissionType:
            self.mock.lists.replace(part, wire_items(mission, part, vehicle_of(kind)))
        flight = flight or Flight(mission, solution=solution, streamed=solution is not None)
        gate = Clearance(flight, peer_of(kind), held_by(self.mock), elsewhere, untimed)
        self.watch: Any = Stream(gate) if solution else Watch(gate, arm=arm, lands=lands)
        self.client, self.solution = Counted(self.watch), solution
        self.times, self.sent, self.places = list[float](), list[Real](), list[Real]()
        self.events, self.others = list[tuple[float, Any]](), list[Station]()
        self.faults, self.until = Faults(), 300.0
        self._record()

    def _record(self) -> None:
        hear = self.mock.flight.hear

        def heard(message: messages.SetPositionTargetLocalNed, now: float) -> bool:
            flight = self.mock.flight
            if flight.armed:
                self.times.append(now)
                self.sent.append(flight.aim(message)[0])
                self.places.append(flight.aircraft.at(now).position)
            return bool(hear(message, now))

        self.mock.flight.hear = heard

    def assert_gated(self, lag: float = 0.0) -> None:
        """Check that it was never sent farther than the gate lets it, and within its fence.

        `lag` is how far it flies, m, while a position and its answer are on the link.
        """
        assert self.solution is not None
        off, area = np.array(self.sent) - np.array(self.places), self.solution.plan.keep_in
        across = np.hypot(*off[:, :2].T)
        assert across.max() <= CAP + lag
        assert np.abs(off[:, 2]).max() <= LEVEL + 2.0 + lag
        for place, to, far in zip(self.places, self.sent, across, strict=True):
            if area is not None and far > NEAR + lag:
                assert area.covers_path(np.array([place[:2], to[:2]]))

    def after(self, begin: float, end: float = float("inf")) -> int:
        """Return how many setpoints it was sent after `begin`, s, and before `end`."""
        return sum(begin < each < end for each in self.times)

    def run(self, looks: Sequence[tuple[float, Callable[[float], object]]] = ()) -> str:
        """Return the kind of the ending, "-" for none; `looks` are called at their times."""
        stations, events = (
            (Station(self.client, GROUND_STATION), Station(self.mock, VEHICLE)),
            [*self.events, *looks],
        )
        simulate(*stations, self.faults, self.until, events=events, others=self.others)
        return self.watch.outcome.kind if self.watch.outcome is not None else "-"

    @property
    def orders(self) -> list[Message]:
        """What was sent that moves the vehicle: everything but requests for telemetry."""
        return [each for each in self.client.sent if not harmless(each)]

    def does(self, number: int, *params: float) -> Any:
        """Return an event: somebody else gives a command."""
        message = CommandLong(VEHICLE, number, 0, *map(float, params))
        return lambda now: self.mock.on(Envelope(FOREIGN, message), now)

    def sets(self, mode: int) -> Any:
        """Return an event: the pilot sets a mode."""
        return lambda now: self.mock.on(Envelope(FOREIGN, messages.SetMode(1, 1, mode)), now)

    def tells(self, lens: Lens) -> None:
        """Let the vehicle send what `lens` makes of each of its messages, and the time."""
        tick, on = self.mock.tick, self.mock.on

        def through(messages: Sequence[Message], now: float) -> list[Message]:
            return [told for message in messages for told in lens(message, now)]

        self.mock.tick = lambda now: through(tick(now), now)
        self.mock.on = lambda envelope, now: through(on(envelope, now), now)

    def loses(self, when: Heard, *, heard: bool = False) -> None:
        """Let what is sent to the vehicle be lost; or, where it is `heard`, its answers."""
        on = self.mock.on

        def hear(envelope: Envelope, now: float) -> Sequence[Message]:
            lost = when(envelope.message, now)
            answers = on(envelope, now) if heard or not lost else ()
            return () if lost else cast(Sequence[Message], answers)

        self.mock.on = hear

    def interrupt(self, now: float) -> None:
        """Press Ctrl-C; what is sent then is lost at first."""
        self.client.sent += self.client.cancel(now)

    def hang_up(self, now: float) -> None:
        """Close the terminal; what is sent then is lost at first."""
        self.client.hang_up(now)

    @property
    def commands(self) -> list[tuple[int, float]]:
        """The commands that were given, with their first parameters."""
        orders = (each for each in self.orders if isinstance(each, CommandLong))
        return [(each.command, each.param1) for each in orders]

    def told(self, words: str) -> bool:
        return any(words in text for text in self.watch.seen.told)


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
    asked = (MavCommand.SET_INTERVAL, MavCommand.REQUEST_MESSAGE)
    asks = isinstance(message, CommandLong) and message.command in asked
    reads = (
        messages.MissionRequestList
        | messages.MissionRequestInt
        | messages.MissionAck
        | messages.ParamRequestRead
        | messages.Timesync
    )
    return asks or isinstance(message, reads)


class AnotherStation(Machine[None]):
    """A ground station that says once a second, from a given time on, that it is there."""

    def __init__(self, since: float = 0.0) -> None:
        super().__init__()
        self._since = since

    def start(self, now: float) -> Sequence[Message]:
        self._due = now + self._since
        return ()

    def _receive(self, *_: object) -> Sequence[Message]:
        return ()

    def _time_out(self, now: float) -> Sequence[Message]:
        self._due = now + 1.0
        return [Heartbeat(protocol.GROUND_STATION_TYPE, protocol.NO_AUTOPILOT, 0, 0, 4)]


class Companion(AnotherStation):
    """A computer on board that tells a place and a mode of its own."""

    def _time_out(self, now: float) -> Sequence[Message]:
        self._due = now + 0.3
        ms, place = round(now * 1000) + 5000, (round(HOME.latitude * 1e7), round(1e9), 9000, 9000)
        return [Heartbeat(18, 8, 0, LOITER, 4), messages.GlobalPositionInt(ms, *place, 0, 0, 0, 0)]
