"""What is to be flown, and the gate before it: against what is held and seen of the vehicle.

Nothing is armed while a `Clearance` finds an error. It is one gate for missions and for setpoints.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.files import MadeFor, addressee_mistake
from faao_mav.autopilot.manners import FenceAction
from faao_mav.errors import InputError, counted
from faao_mav.fly.telemetry import Ending, Telemetry
from faao_mav.mission.item import Home, Mission
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule.conversion import Conversion
from faao_mav.validate import Check, Limits, check
from faao_mav.validate.rule import Finding, Level, read_rules
from faao_mav.validate.speeds import beyond_lean
from faao_mav.wire import whereabouts
from faao_mav.wire.jobs import Held, read_held
from faao_mav.wire.machine import Script
from faao_mav.wire.messages import Message
from faao_mav.wire.parameters import number_in
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.transfer import Peer
from faao_mav.wire.whereabouts import Whereabouts
from faao_mav.wire.wire_items import mission_of, wire_items

LEAST_BATTERY = 30
"""Percent of the battery with which a flight begins at least, where nothing tells what it takes.
Chosen: twice what PX4 takes for low by default."""

_LOOK = 5.0
"""Seconds after which it is told what stands against a flight, though the vehicle's place is not
known; chosen."""

_AT_FENCE: dict[FenceAction, str] = {
    "nothing": "flies on",
    "report": "says so and flies on",
    "hold": "holds",
    "return": "returns",
    "land": "lands where it is",
    "terminate": "terminates the flight",
}

_TABLE = {rule.id: rule for rule in read_rules("fly/preflight.tsv", {})}
"""What stands against a flight, or is worth knowing before it, by the ids of the findings."""


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """What is to be flown: `mission`, or, `streamed`, the plan of `solution` by setpoints.

    `vehicle` has the parameters that the mission is timed for, whose `source` says where they come
    from; `made_for` says what is known of whom it was made for. A `solution` tells what the flight
    is to deliver, and may tell what it takes of the battery.

    >>> from faao_mav import Vehicle, read_mission
    >>> flight = Flight(read_mission("tests/data/missions/plain.waypoints"), Vehicle())
    >>> flight.streamed, flight.solution
    (False, None)
    """

    mission: Mission
    vehicle: Vehicle = field(default_factory=Vehicle)
    made_for: MadeFor = field(default_factory=MadeFor)
    solution: Solution | None = None
    streamed: bool = False

    @classmethod
    def planned(
        cls, conversion: Conversion, solution: Solution, *, streamed: bool = False
    ) -> "Flight":
        """Return the flight of the mission that `solution` was made into."""
        vehicle = conversion.vehicle
        made_for = MadeFor(vehicle.autopilot, vehicle.kind, "as the plan says")
        return cls(conversion.mission, vehicle, made_for, solution, streamed)

    @property
    def placed(self) -> Mission:
        """The mission with the home that its flight counts from: of a stream, its plan's."""
        if not self.streamed or self.solution is None:
            return self.mission
        origin = self.solution.plan.origin
        home = Home(origin.latitude, origin.longitude, origin.elevation)
        return replace(self.mission, home=home)


@dataclass(slots=True, eq=False)
class Clearance:
    """Whether the vehicle of `peer`, which `held` this, is clear for `flight`: without an error.

    `elsewhere` allows another place than the mission was made for, `untimed` other parameters than
    it is timed for; what they overrule is told as a warning. `findings` is what was found last;
    None before enough is heard of the vehicle, and of one that is not `judged`.
    """

    flight: Flight
    peer: Peer
    held: Held
    elsewhere: bool = False
    untimed: bool = False
    judged: bool = True
    findings: tuple[Finding, ...] | None = None
    reading: Script[Held] | None = None
    _state: tuple[object, ...] = ()

    def judge(self, seen: Telemetry, now: float, *, again: bool = False) -> None:
        """Look, once enough is heard, and `again` or when that is another state."""
        known = seen.place is not None and seen.status is not None
        heard = seen.heartbeat is not None and (known or now >= seen.begun + _LOOK)
        others = len(seen.stations), len(seen.strangers)
        state = seen.place is None, seen.armed, seen.custom_mode, seen.row, others
        if self.judged and heard and (again or state != self._state):
            self._state, self.findings = state, self.found(seen)

    def found(self, seen: Telemetry) -> tuple[Finding, ...]:
        """Return what stands against the flight by what it holds, and was `seen` of it."""
        flight, held = self.flight, self.held
        mistake = addressee_mistake(flight.made_for, seen.vehicle)
        if mistake is not None:
            return (_found("vehicle-other", mistake=mistake),)
        judged = _judged(flight, held, seen, elsewhere=self.elsewhere)
        found = [
            *_state(flight, seen, judged),
            *_place(flight, held, seen),
            *_lists(flight, held, seen, judged.vehicle),
            *_timing(flight, held, seen),
            *(each for each in judged.findings if each.level is not Level.NOTE),
            *_by_itself(flight, held, seen, judged.vehicle),
        ]
        found = [self._overruled(each) for each in found]
        return tuple(sorted(found, key=lambda each: [*Level].index(each.level)))

    def _overruled(self, found: Finding) -> Finding:
        """Return what was found, as a warning where an option allows it."""
        option = {"place": "elsewhere", "timing": "untimed"}.get(found.rule.partition("-")[0])
        if option is None or not getattr(self, option) or found.level is not Level.ERROR:
            return found
        return replace(found, level=Level.WARNING, action=f"--{option}: flown all the same")

    @property
    def is_clear(self) -> bool:
        """Whether it has looked, and found no error."""
        return self.findings is not None and not self._errors

    @property
    def _errors(self) -> list[Finding]:
        return [each for each in self.findings or () if each.level is Level.ERROR]

    def refusal(self) -> Ending | None:
        """Return how a flight ends that is not started for an error; a place is waited for."""
        stops = [each for each in self._errors if each.rule != "position-unknown"]
        told = "; ".join(f"{each.message} ({each.action})" for each in stops)
        contested = any(each.rule == "ground-station" for each in stops)
        ending = Ending("contested" if contested else "refused", f"nothing was started: {told}")
        return ending if stops else None

    def read_again(self, now: float) -> Sequence[Message] | None:
        """Read once more what it holds; return what to say for that, None once it is read."""
        if self.reading is None:
            self.reading = Script(read_held(self.peer))
            return self.reading.start(now)
        if self.reading.outcome is None:
            return self.reading.tick(now)
        self.held, self.reading = self.reading.outcome, None  # next time it is read anew
        return None


def _found(row: str, level: Level | None = None, rule: str = "", **values: object) -> Finding:
    """Return what a `row` of the table says of `values`, at its own level and under its own id."""
    found = _TABLE[row].finding(None, values)
    return replace(found, level=level or found.level, rule=rule or found.rule)


def _judged(flight: Flight, held: Held, seen: Telemetry, *, elsewhere: bool) -> Check:
    """Return what validation says of the mission, from where it stands, with what it holds.

    How a mission keeps its plan does not matter to a stream, which does it by setpoints.
    """
    mission, solution = flight.placed, flight.solution
    with suppress(InputError):  # which is told as another list than the file's
        own = mission_of(held.lists, seen.vehicle)
        mission = replace(mission, fence=own.fence, rally=own.rally)
    if seen.place is not None and (elsewhere or Whereabouts.of(seen.place, mission).is_meant):
        mission = replace(mission, home=seen.place)
    kind, values, body = seen.vehicle, held.reading.values, flight.vehicle.body
    vehicle = Vehicle(kind.family.key, kind.kind, values, "the vehicle", body).usable()
    limits = None if solution is None else Limits(max_speed=solution.plan.vehicle.max_speed)
    found = check(mission, vehicle, limits=limits, solution=solution)

    def counts(each: Finding) -> bool:
        late = each.rule.startswith("link-") and each.level is Level.WARNING
        return not (flight.streamed and (late or each.rule == "speed-above-limit"))

    return replace(found, findings=tuple(filter(counts, found.findings)))


def _state(flight: Flight, seen: Telemetry, judged: Check) -> Iterator[Finding]:
    if seen.armed:
        yield _found("armed")
    if seen.stations:
        yield _found("ground-station", who="; ".join(sorted(seen.stations)))
    if seen.strangers:
        yield _found("number-twice", where=", ".join(sorted(seen.strangers)))
    on_mission = seen.custom_mode == seen.vehicle.modes.mission  # it is not armed in that
    if not flight.streamed and seen.row is not None and seen.row > 1:
        yield _found("item-not-first", Level.WARNING if on_mission else None, seen=seen)
    if not (flight.streamed or on_mission) and seen.custom_mode in seen.vehicle.modes.not_to_arm_in:
        yield _found("mode", seen=seen)
    energy, least = judged.energy, float(LEAST_BATTERY)
    why = "where no plan tells what the flight takes"
    if energy is not None and energy.battery is not None:
        takes = 100 * energy.total / energy.battery.capacity_wh
        least = takes + energy.battery.reserve
        why = f"the flight takes {takes:.0f} %, and is to leave {energy.battery.reserve:g} %"
    if seen.battery is None:
        yield _found("battery-unknown")
    elif seen.battery < least:
        yield _found("battery-low", percent=seen.battery, least=least, why=why)


def _place(flight: Flight, held: Held, seen: Telemetry) -> Iterator[Finding]:
    place, home = seen.place, held.home
    if place is None:
        yield _found("position-unknown")
        return
    stands = Whereabouts.of(place, flight.placed)
    away, higher, first = stands.from_home, stands.higher, stands.from_first
    if away is not None and not away <= whereabouts.HOME_AWAY:
        yield _found("place-home", away=whereabouts.shown(away), most=whereabouts.HOME_AWAY)
    if higher is not None and not abs(higher) <= whereabouts.HOME_HIGHER:
        yield _found("place-height", stands=stands, most=whereabouts.HOME_HIGHER)
    if away is not None and higher is None:
        yield _found("place-height-unknown")
    if first is not None and not first <= whereabouts.FIRST_AWAY:
        near = away is not None and first <= whereabouts.FIRST_FARTHEST
        yield _found("place-first", Level.WARNING if near else None, away=whereabouts.shown(first))
    off = 0.0 if home is None else whereabouts.distance(place, (home.latitude, home.longitude))
    if not off <= whereabouts.HOME_AWAY:
        yield _found("returns-elsewhere", away=whereabouts.shown(off))


def _lists(flight: Flight, held: Held, seen: Telemetry, own: Vehicle) -> Iterator[Finding]:
    """Yield where what it holds is not what the file has, no more and no less."""
    for part in MissionType:
        rule, rows = f"holds-{part.name.lower()}", held.lists.get(part, ())
        wanted = wire_items(flight.mission, part, seen.vehicle)
        if part in held.missing:
            yield _found("holds-unread", rule=rule, title=part.title)
        elif wanted:
            for wrong in held.other_than(wanted, part, seen.vehicle)[:1]:
                yield _found("holds-another", rule=rule, wrong=wrong)
        elif rows:
            fence, items = part is MissionType.FENCE, counted(len(rows), "item")
            idle = fence and own.type.at_fence(own).action == "nothing"
            says = {"title": "a fence" if fence else part.title, "items": items}
            says["idle"] = ", and does nothing about it" if idle else ""
            yield _found("holds-more", Level.WARNING if idle else None, rule, **says)


def _timing(flight: Flight, held: Held, seen: Telemetry) -> Iterator[Finding]:
    """Yield where its parameters are not those that the mission is timed for."""
    given, values = flight.vehicle.parameters, held.reading.values
    other, unread, assumed = list[str](), list[str](), list[str]()
    for parameter in seen.vehicle.parameters.values():
        timed = parameter.motion and parameter.name_in(given) is not None
        name = parameter.name_in(values)
        if name is None:
            (unread if timed else assumed).append(" or ".join(parameter.names))
        elif timed:
            wanted = number_in(parameter, name, given)
            if wanted is not None and not math.isclose(values[name], wanted, rel_tol=1e-6):
                other.append(f"{name} is {values[name]:g}, not {wanted:g}")
    rows = {"timing-other": other, "timing-unread": unread, "parameters-unread": assumed}
    for row, names in rows.items():
        # Setpoints come when they are due, whatever the mission's time is.
        level = Level.WARNING if flight.streamed and row.startswith("timing") else None
        if names:
            yield _found(row, level, names=", ".join(names))
    if not given:
        yield _found("timing-unknown")


def _by_itself(flight: Flight, held: Held, seen: Telemetry, own: Vehicle) -> Iterator[Finding]:
    """Yield what it does by itself on a loss, one line each."""
    values, rules = held.reading.values, seen.vehicle.family.setpoints
    for failsafe in own.type.failsafes:
        loss, rule = failsafe.loss, f"on-{failsafe.loss.lower().replace(' ', '-')}"
        told = failsafe.told(values, streamed=flight.streamed)
        if told is None:
            names = ", ".join(name for name in failsafe.defaults if name not in values)
            yield _found("loss-unknown", rule=rule, loss=loss, names=names)
        else:
            row = "loss-acts" if told.acts else "loss-idle"
            yield _found(row, rule=rule, loss=loss, does=told.text)
    if flight.streamed:
        lean = None if flight.solution is None else beyond_lean(flight.solution, own)
        if lean is not None:
            yield _found("lean", told=lean)
        refusal = rules.refusal(values)
        does, instead = refusal or (f"setpoints lost: {rules.without(values)}", "")
        level = Level.ERROR if refusal else Level.NOTE
        yield _found("on-setpoints-lost", level, does=does, instead=instead)
    if held.lists.get(MissionType.FENCE):
        response = own.type.at_fence(own)
        does, name = _AT_FENCE[response.action], own.name_of(response.parameter)
        instead = "" if response.keeps else f"set {name} {response.set_to}"
        level = Level.NOTE if response.keeps else Level.WARNING
        yield _found("on-fence-left", level, does=does, name=name, instead=instead)
    if (height := own.value("return_height", 0.0)) > 0:
        yield _found("on-return", height=height, name=own.name_of("return_height"))
