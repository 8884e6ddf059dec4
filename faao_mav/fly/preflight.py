"""The gate before a flight: what is to be flown against what is held and seen of the vehicle.

Nothing is armed while `preflight` finds an error. It is one gate for missions and for setpoints. A
`Readiness` is that of one flight while its vehicle is watched.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib.resources import files

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.files import addressee_mistake
from faao_mav.autopilot.manners import FenceAction
from faao_mav.fly.seen import Flight, Held, read_held
from faao_mav.fly.telemetry import Telemetry
from faao_mav.validate import Limits
from faao_mav.validate.check import Check, check, predicted
from faao_mav.validate.rule import Finding, Level, Rule, rows_of
from faao_mav.validate.speeds import beyond_lean
from faao_mav.validate.words import counted
from faao_mav.wire.machine import Script
from faao_mav.wire.messages import Envelope, Message
from faao_mav.wire.parameters import number_in
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.transfer import Peer
from faao_mav.wire.whereabouts import (
    FIRST_AWAY,
    FIRST_FARTHEST,
    HOME_AWAY,
    HOME_HIGHER,
    Whereabouts,
    distance,
    shown,
)
from faao_mav.wire.wire_items import wire_items

LEAST_BATTERY = 30
"""Percent of the battery with which a flight begins at least, where nothing tells what it takes.
Chosen: twice what PX4 takes for low by default."""

_LOOK = 5.0
"""Seconds after which it is told what stands against a flight, though its place is not known.
Chosen."""

_AT_FENCE: dict[FenceAction, str] = {
    "nothing": "flies on",
    "report": "says so and flies on",
    "hold": "holds",
    "return": "returns",
    "land": "lands where it is",
    "terminate": "terminates the flight",
}

_TABLE = {
    name: Rule(Level(level), name, None, None, "", says, do, "")
    for level, name, says, do in rows_of(files("faao_mav.fly").joinpath("preflight.tsv"))
}
"""What stands against a flight, or is worth knowing before it, by the ids of the findings."""


def preflight(
    flight: Flight, held: Held, seen: Telemetry, *, elsewhere: bool = False, untimed: bool = False
) -> tuple[Finding, ...]:
    """Return what stands against `flight` by a vehicle that `held` this and was `seen` so.

    An error means that it is not armed. `elsewhere` allows another place than the mission was made
    for, `untimed` other parameters than it is timed for; what they overrule is told as a warning.
    """
    mistake = addressee_mistake(flight.made_for, seen.vehicle)
    if mistake is not None:
        return (_found("vehicle-other", mistake=mistake),)
    judged = _judged(flight, held, seen, elsewhere=elsewhere)
    found = [
        *_state(flight, seen),
        *_place(flight, held, seen),
        *_lists(flight, held, seen, judged.vehicle),
        *_timing(flight, held, seen, judged),
        *_battery(seen, judged),
        *(each for each in judged.findings if each.level is not Level.NOTE),
        *_by_itself(flight, held, seen, judged.vehicle),
    ]
    for rules, option, given in (
        ("place-", "--elsewhere", elsewhere),
        ("timing-", "--untimed", untimed),
    ):
        for k, each in enumerate(found):
            if given and each.level is Level.ERROR and each.rule.startswith(rules):
                action = f"{option}: flown all the same"
                found[k] = replace(each, level=Level.WARNING, action=action)
    return tuple(sorted(found, key=lambda each: [*Level].index(each.level)))


def _found(row: str, level: Level | None = None, rule: str = "", **values: object) -> Finding:
    """Return what a `row` of the table says of `values`, at its own level and under its own id."""
    found = _TABLE[row].finding(None, values)
    return replace(found, level=level or found.level, rule=rule or found.rule)


def _judged(flight: Flight, held: Held, seen: Telemetry, *, elsewhere: bool) -> Check:
    """Return what validation says of the mission, from where it stands, with what it holds.

    How a mission keeps its plan does not matter to a stream, which does it by setpoints.
    """
    mission, solution = held.beside(flight.placed, seen.vehicle), flight.solution
    if seen.place is not None and (elsewhere or Whereabouts.of(seen.place, mission).is_meant):
        mission = replace(mission, home=seen.place)
    vehicle = replace(
        flight.vehicle,
        autopilot=seen.vehicle.family.key,
        kind=seen.vehicle.kind,
        parameters=held.reading.values,
        source="the vehicle",
    ).usable()
    limits = None if solution is None else Limits(max_speed=solution.plan.vehicle.max_speed)
    found = check(mission, vehicle, limits=limits, solution=solution)

    def counts(each: Finding) -> bool:
        late = each.rule.startswith("link-") and each.level is Level.WARNING
        return not (flight.streamed and (late or each.rule == "speed-above-limit"))

    return replace(found, findings=tuple(filter(counts, found.findings)))


def _state(flight: Flight, seen: Telemetry) -> Iterator[Finding]:
    if seen.armed:
        yield _found("armed")
    if seen.stations:
        yield _found("ground-station", who="; ".join(sorted(seen.stations)))
    if seen.strangers:
        yield _found("number-twice", where=", ".join(sorted(seen.strangers)))
    if not flight.streamed and seen.row is not None and seen.row > 1:
        yield _found("item-not-first", seen=seen)
    if not flight.streamed and seen.custom_mode in seen.vehicle.modes.not_to_arm_in:
        yield _found("mode", seen=seen)


def _place(flight: Flight, held: Held, seen: Telemetry) -> Iterator[Finding]:
    place, home = seen.place, held.home
    if place is None:
        yield _found("position-unknown")
        return
    stands = Whereabouts.of(place, flight.placed)
    away, higher, first = stands.from_home, stands.higher, stands.from_first
    if away is not None and not away <= HOME_AWAY:
        yield _found("place-home", away=shown(away), most=HOME_AWAY)
    if higher is not None and not abs(higher) <= HOME_HIGHER:
        yield _found("place-height", stands=stands, most=HOME_HIGHER)
    if away is not None and higher is None:
        yield _found("place-height-unknown")
    if first is not None and not first <= FIRST_AWAY:
        near = away is not None and first <= FIRST_FARTHEST
        yield _found("place-first", Level.WARNING if near else None, away=shown(first))
    off = 0.0 if home is None else distance(place, (home.latitude, home.longitude))
    if not off <= HOME_AWAY:
        yield _found("returns-elsewhere", away=shown(off))


def _lists(flight: Flight, held: Held, seen: Telemetry, own: Vehicle) -> Iterator[Finding]:
    """Yield where what it holds is not what the file has, no more and no less."""
    for part in MissionType:
        rule, rows = f"holds-{part.name.lower()}", held.rows(part, seen.vehicle)
        wanted = wire_items(flight.mission, part, seen.vehicle)
        if part in held.missing:
            yield _found("holds-unread", rule=rule, title=part.title)
        elif wanted:
            for wrong in held.other_than(wanted, part, seen.vehicle)[:1]:
                yield _found("holds-another", rule=rule, wrong=wrong)
        elif rows:
            title, level, idle = part.title, Level.ERROR, ""
            if part is MissionType.FENCE:
                title = "a fence"
                if own.type.at_fence(own).action == "nothing":
                    level, idle = Level.WARNING, ", and does nothing about it"
            items = counted(len(rows), "item")
            yield _found("holds-more", level, rule, title=title, items=items, idle=idle)


def _timing(flight: Flight, held: Held, seen: Telemetry, judged: Check) -> Iterator[Finding]:
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
    # Setpoints come when they are due, whatever the mission's time is.
    level = Level.WARNING if flight.streamed else None
    if other:
        late = _lateness(flight, judged)
        yield _found("timing-other", level, names=", ".join(other), late=late)
    if unread:
        yield _found("timing-unread", level, names=", ".join(unread))
    if assumed:
        yield _found("parameters-unread", names=", ".join(assumed))
    if not given:
        yield _found("timing-unknown")


def _lateness(flight: Flight, judged: Check) -> str:
    """Return how long the flight takes with the parameters of both, as the end of a sentence."""
    own = replace(judged.vehicle, parameters=flight.vehicle.parameters).usable()
    meant, _ = predicted(judged.mission, own, judged.wind)
    if judged.track is None or meant is None:
        return ""
    return f"; predicted to take {judged.track.t[-1]:.1f} s, not {meant.t[-1]:.1f} s"


def _battery(seen: Telemetry, judged: Check) -> Iterator[Finding]:
    energy, percent = judged.energy, seen.battery
    if percent is None:
        yield _found("battery-unknown")
        return
    least, why = float(LEAST_BATTERY), "where no plan tells what the flight takes"
    if energy is not None and energy.battery is not None:
        takes = 100 * energy.total / energy.battery.capacity_wh
        least = takes + energy.battery.reserve
        why = f"the flight takes {takes:.0f} %, and is to leave {energy.battery.reserve:g} %"
    if percent < least:
        yield _found("battery-low", percent=percent, least=least, why=why)


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
    if flight.streamed and flight.solution is not None:
        lean = beyond_lean(flight.solution, own)
        yield from [_found("lean", told=lean)] if lean is not None else []
    if flight.streamed and (refusal := rules.refusal(values)) is not None:
        yield _found("on-setpoints-lost", does=refusal[0], instead=refusal[1])
    elif flight.streamed:
        does = f"setpoints lost: {rules.without(values)}"
        yield _found("on-setpoints-lost", Level.NOTE, does=does, instead="")
    if held.rows(MissionType.FENCE, seen.vehicle):
        response = own.type.at_fence(own)
        does, name = _AT_FENCE[response.action], own.name_of(response.parameter)
        level, instead = Level.WARNING, f"set {name} {response.set_to}"
        if response.keeps:
            level, instead = Level.NOTE, ""
        yield _found("on-fence-left", level, does=does, name=name, instead=instead)
    height = own.vertical.return_height
    if height > 0 and "return_height" in own.type.parameters:
        yield _found("on-return", height=height, name=own.name_of("return_height"))


class Readiness:
    """The gate of `flight` by the vehicle of `peer`, of which `held` was read just before.

    For what is `allowed` see `preflight`. `findings` is what it found last, None before. `judge`
    looks now and then; before it is armed `settle` reads it again, while `on` is given what
    arrives.
    """

    def __init__(self, flight: Flight, held: Held, peer: Peer, **allowed: bool) -> None:
        self._flight, self._held, self._peer = flight, held, peer
        self._allowed = allowed
        self.findings: tuple[Finding, ...] | None = None
        self._judged: tuple[object, ...] = ()
        self._reading: Script[Held] | None = None

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Those of `findings` for which nothing is armed."""
        return tuple(each for each in self.findings or () if each.level is Level.ERROR)

    @property
    def values(self) -> dict[str, float]:
        """The vehicle's parameters that a flight depends on, by name."""
        return self._held.reading.values

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Take note of what the vehicle says, and answer it."""
        return () if self._reading is None else self._reading.on(envelope, now)

    def judge(self, seen: Telemetry, now: float, *, again: bool = False) -> None:
        """Judge what is heard, once enough is, and `again` or when that is another state."""
        known = seen.place is not None and seen.status is not None
        if seen.heartbeat is None or not (known or now >= seen.begun + _LOOK):
            return
        others = len(seen.stations), len(seen.strangers)
        state = seen.place is None, seen.armed, seen.custom_mode, seen.row, others
        if again or state != self._judged:
            self._judged = state
            self.findings = preflight(self._flight, self._held, seen, **self._allowed)

    def settle(self, seen: Telemetry, now: float) -> Sequence[Message] | None:
        """Return what is to be sent until the gate is up to date; None: `findings` is.

        What it holds is read again; without fresh news of the vehicle it waits.
        """
        if self._reading is None:
            self._reading = Script(read_held(self._peer))
            return self._reading.start(now)
        if self._reading.outcome is None:
            return self._reading.tick(now)
        if not seen.is_fresh(now):
            return ()
        self._held = self._reading.outcome
        self.judge(seen, now, again=True)
        return None

    def cancel(self, now: float) -> Sequence[Message]:
        """Read no more."""
        return () if self._reading is None else self._reading.cancel(now)
