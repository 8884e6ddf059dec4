"""The gate before a flight: what is to be flown against what is held and seen of the vehicle.

Nothing is armed while `preflight` finds an error. It is one gate for missions and for setpoints.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.files import addressee_mistake
from faao_mav.autopilot.manners import FenceAction
from faao_mav.fly.seen import Flight, Held
from faao_mav.fly.telemetry import Telemetry
from faao_mav.validate import Limits
from faao_mav.validate.check import Check, check
from faao_mav.validate.rule import Finding, Level
from faao_mav.validate.words import counted
from faao_mav.wire.parameters import close, number_in
from faao_mav.wire.protocol import MissionType
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

_AT_FENCE: dict[FenceAction, str] = {
    "nothing": "flies on",
    "report": "says so and flies on",
    "hold": "holds",
    "return": "returns",
    "land": "lands where it is",
    "terminate": "terminates the flight",
}


def preflight(
    flight: Flight, held: Held, seen: Telemetry, *, elsewhere: bool = False, untimed: bool = False
) -> tuple[Finding, ...]:
    """Return what stands against `flight` by a vehicle that `held` this and was `seen` so.

    An error means that it is not armed. `elsewhere` allows another place than the mission was made
    for, `untimed` other parameters than it is timed for; what they overrule is told as a warning.
    """
    mistake = addressee_mistake(flight.made_for, seen.vehicle)
    if mistake is not None:
        action = "connect to its vehicle, or make another mission"
        return (_error("vehicle-other", mistake, action),)
    judged = _judged(flight, held, seen, elsewhere=elsewhere)
    found = [
        *_state(flight, seen),
        *_place(flight, held, seen),
        *_lists(flight, held, seen, judged.vehicle),
        *_timing(flight, held, seen, judged),
        *_battery(seen, judged),
        *(each for each in judged.findings if each.level is not Level.NOTE),
        *_failsafes(flight, held, seen, judged.vehicle),
    ]
    if elsewhere:
        found = [_overruled(each, "place-", "--elsewhere") for each in found]
    if untimed:
        found = [_overruled(each, "timing-", "--untimed") for each in found]
    return tuple(sorted(found, key=lambda each: [*Level].index(each.level)))


def _found(level: Level, rule: str, message: str, action: str = "") -> Finding:
    return Finding(level, rule, None, message, action)


_error, _warning, _note = (partial(_found, level) for level in Level)


def _overruled(found: Finding, rules: str, option: str) -> Finding:
    """Return what was `found`; an error by one of the `rules` as a warning that names `option`."""
    if found.level is not Level.ERROR or not found.rule.startswith(rules):
        return found
    return replace(found, level=Level.WARNING, action=f"{option}: flown all the same")


def _judged(flight: Flight, held: Held, seen: Telemetry, *, elsewhere: bool) -> Check:
    """Return what validation says of the mission, from where it stands, with what it holds."""
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
    kept = [each for each in found.findings if not (flight.streamed and _of_the_mission(each))]
    return replace(found, findings=tuple(kept))


def _of_the_mission(found: Finding) -> bool:
    """Tell whether it is about how a mission keeps its plan, which a stream does by setpoints."""
    late = found.rule.startswith("link-") and found.level is Level.WARNING
    return late or found.rule == "speed-above-limit"


def _state(flight: Flight, seen: Telemetry) -> Iterator[Finding]:
    if seen.armed:
        yield _error("armed", "it is armed already", "disarm it, or watch it without --arm")
    if seen.stations:
        yield _error(
            "ground-station",
            f"another ground station is on the link ({'; '.join(sorted(seen.stations))})",
            "close it, or let it start the mission",
        )
    if seen.strangers:
        where = ", ".join(sorted(seen.strangers))
        message = f"its number is used by another vehicle too, at {where}"
        yield _error("number-twice", message, "give each a number of its own")
    if flight.streamed:
        return
    if seen.row is not None and seen.row > 1:
        message = f"it would go on at item {seen.row}, not at the beginning"
        yield _error("item-not-first", message, "set the first item (or reboot)")
    if seen.custom_mode in seen.vehicle.modes.not_to_arm_in:
        yield _error(
            "mode",
            f"it is in mode {seen.mode}, in which it is not armed, or flies as soon as it is",
            "set the mode in which the pilot is to take over",
        )


def _place(flight: Flight, held: Held, seen: Telemetry) -> Iterator[Finding]:
    place, mission = seen.place, flight.placed
    if place is None:
        message = "it does not tell where it stands"
        yield _error("position-unknown", message, "wait until it has a position, under open sky")
        return
    stands = Whereabouts.of(place, mission)
    action = "carry it there, or make a mission for here; --elsewhere flies it from here"
    if stands.from_home is not None and not stands.from_home <= HOME_AWAY:
        away = f"{shown(stands.from_home)} from the mission's home, not within {HOME_AWAY:g} m"
        yield _error("place-home", f"it stands {away}", action)
    if stands.higher is not None and not abs(stands.higher) <= HOME_HIGHER:
        yield _error(
            "place-height",
            f"it stands {stands.height_shown} than the mission's home, not within "
            f"{HOME_HIGHER:g} m: heights count from where it stands, so that all of the flight is "
            "as much off",
            "see which height above sea level is right, the vehicle's or the mission's "
            "(site.origin.elevation); --elsewhere flies it all the same",
        )
    if stands.from_home is not None and stands.higher is None:
        message = "the mission does not tell how high its home is: it may be for another height"
        yield _warning("place-height-unknown", message, "give the home its height above sea level")
    first = stands.from_first
    if first is not None and not first <= FIRST_AWAY:
        far = stands.from_home is None or not first <= FIRST_FARTHEST
        message = f"the mission's first place is {shown(first)} from where it stands"
        yield (_error if far else _warning)("place-first", message, action)
    home = held.home
    off = 0.0 if home is None else distance(place, (home.latitude, home.longitude))
    if not off <= HOME_AWAY:
        message = f"its own home, where it returns to, is {shown(off)} from where it stands"
        action = "set its home here with the ground station, unless that is meant"
        yield _warning("returns-elsewhere", message, action)


def _lists(flight: Flight, held: Held, seen: Telemetry, own: Vehicle) -> Iterator[Finding]:
    """Yield where what it holds is not what the file has, no more and no less."""
    for part in MissionType:
        rule, rows = f"holds-{part.name.lower()}", held.rows(part, seen.vehicle)
        wanted = wire_items(flight.mission, part, seen.vehicle)
        if part in held.missing:
            yield _error(rule, f"{part.title}: what it holds cannot be read", "try again")
        elif wanted:
            for wrong in held.other_than(wanted, part, seen.vehicle)[:1]:
                yield _error(rule, f"it holds another one: {wrong}", "upload it again")
        elif rows:
            idle = part is MissionType.FENCE and own.type.at_fence(own).action == "nothing"
            what = "a fence" if part is MissionType.FENCE else part.title
            message = f"it holds {what} ({counted(len(rows), 'item')}) that the file has not"
            action = "take that into the file (download), or remove it (upload --clear-rest)"
            if idle:
                yield _warning(rule, f"{message}, and does nothing about it", action)
            else:
                yield _error(rule, message, action)


def _timing(flight: Flight, held: Held, seen: Telemetry, judged: Check) -> Iterator[Finding]:
    """Yield where its parameters are not those that the mission is timed for."""
    given, values = flight.vehicle.parameters, held.reading.values
    other, unread, assumed = list[str](), list[str](), list[str]()
    for parameter in seen.vehicle.parameters.values():
        timed = parameter.motion and parameter.name_in(given) is not None
        name = next((each for each in parameter.names if each in values), None)
        if name is None:
            (unread if timed else assumed).append(" or ".join(parameter.names))
        elif timed:
            wanted = number_in(parameter, name, given)
            if wanted is not None and not close(values[name], wanted):
                other.append(f"{name} is {values[name]:g}, not {wanted:g}")
    # Setpoints come when they are due, whatever the mission's time is.
    told = _warning if flight.streamed else _error
    if other:
        message = f"other parameters than the mission is timed for: {', '.join(other)}"
        action = "set them (upload --parameters FILE), or --untimed flies it late or early"
        yield told("timing-other", f"{message}{_lateness(flight, judged)}", action)
    if unread:
        message = f"not read, though the mission is timed for them: {', '.join(unread)}"
        yield told("timing-unread", message, "try again, or --untimed flies it all the same")
    if assumed:
        message = f"not read, and taken for their defaults: {', '.join(assumed)}"
        yield _note("parameters-unread", message)
    if not given:
        yield _note("timing-unknown", "nothing tells which parameters the mission is timed for")


def _lateness(flight: Flight, judged: Check) -> str:
    """Return how long the flight takes with the parameters of both, as the end of a sentence."""
    own = replace(judged.vehicle, parameters=flight.vehicle.parameters).usable()
    meant = check(judged.mission, own, wind=judged.wind).track
    if judged.track is None or meant is None:
        return ""
    return f"; predicted to take {judged.track.t[-1]:.1f} s, not {meant.t[-1]:.1f} s"


def _battery(seen: Telemetry, judged: Check) -> Iterator[Finding]:
    energy, percent = judged.energy, seen.battery
    if percent is None:
        action = "see to it that the battery is full"
        yield _warning("battery-unknown", "it does not tell its battery", action)
        return
    least, why = float(LEAST_BATTERY), "where no plan tells what the flight takes"
    if energy is not None and energy.battery is not None:
        takes = 100 * energy.total / energy.battery.capacity_wh
        least = takes + energy.battery.reserve
        why = f"the flight takes {takes:.0f} %, and is to leave {energy.battery.reserve:g} %"
    if percent < least:
        message = f"its battery is at {percent} %, which is below {least:.0f} %: {why}"
        yield _error("battery-low", message, "change the battery")


def _failsafes(flight: Flight, held: Held, seen: Telemetry, own: Vehicle) -> Iterator[Finding]:
    """Yield what it does by itself on a loss, one line each."""
    values = held.reading.values
    for failsafe in own.type.failsafes:
        rule = f"on-{failsafe.loss.lower().replace(' ', '-')}"
        told = failsafe.told(values, streamed=flight.streamed)
        if told is None:
            names = ", ".join(name for name in failsafe.defaults if name not in values)
            message = f"{failsafe.loss}: what it does is not known: {names} not read"
            yield _warning(rule, message, "try again, or look it up in the ground station")
        elif told.acts:
            yield _note(rule, f"{failsafe.loss}: it {told.text}")
        else:
            action = "set what it is to do, unless that is meant: see docs/first-flight.md"
            yield _warning(rule, f"{failsafe.loss}: it {told.text}", action)
    if flight.streamed:
        rules = seen.vehicle.family.setpoints
        if (refusal := rules.refusal(values)) is not None:
            yield _error("on-setpoints-lost", *refusal)
        else:
            yield _note("on-setpoints-lost", f"setpoints lost: {rules.without(values)}")
    if held.rows(MissionType.FENCE, seen.vehicle):
        response = own.type.at_fence(own)
        name = own.name_of(response.parameter)
        level, action = Level.WARNING, f"set {name} {response.set_to}"
        if response.keeps:
            level, action = Level.NOTE, ""
        message = f"fence left: it {_AT_FENCE[response.action]} ({name})"
        yield _found(level, "on-fence-left", message, action)
    height = own.vertical.return_height
    if height > 0 and "return_height" in own.type.parameters:
        name = own.name_of("return_height")
        yield _note("on-return", f"a return is flown {height:g} m above home at least ({name})")
