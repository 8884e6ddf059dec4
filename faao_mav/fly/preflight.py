"""The gate before a flight: what is to be flown against what was seen of the vehicle.

Nothing is armed while `preflight` finds an error. It is one gate for missions and for setpoints.
"""

from collections.abc import Iterator
from dataclasses import replace

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.files import addressee_mistake
from faao_mav.autopilot.manners import FenceAction
from faao_mav.fly.seen import Flight, Seen
from faao_mav.validate import Limits
from faao_mav.validate.check import Check, check
from faao_mav.validate.rule import Finding, Level
from faao_mav.validate.words import counted
from faao_mav.wire.parameters import close, number_in
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.transfer.verify import compare
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

_ORDER = {Level.ERROR: 0, Level.WARNING: 1, Level.NOTE: 2}

_PLACE, _TIMING = "place-", "timing-"
"""How the rules begin that --elsewhere and --untimed overrule."""

_AT_FENCE: dict[FenceAction, str] = {
    "nothing": "flies on",
    "report": "says so and flies on",
    "hold": "holds",
    "return": "returns",
    "land": "lands where it is",
    "terminate": "terminates the flight",
}


def preflight(
    flight: Flight, seen: Seen, *, elsewhere: bool = False, untimed: bool = False
) -> tuple[Finding, ...]:
    """Return what stands against `flight` by the vehicle that was `seen`, and what to know of it.

    An error means that it is not armed. `elsewhere` allows another place than the mission was made
    for, `untimed` other parameters than it is timed for; what they overrule is told as a warning.
    """
    mistake = addressee_mistake(flight.made_for, seen.vehicle)
    if mistake is not None:
        return (
            _error("vehicle-other", mistake, "connect to its vehicle, or make another mission"),
        )
    judged = _judged(flight, seen, elsewhere=elsewhere)
    found = [
        *_state(flight, seen),
        *_place(flight, seen),
        *_lists(flight, seen, judged.vehicle),
        *_timing(flight, seen, judged),
        *_battery(seen, judged),
        *(each for each in judged.findings if each.level is not Level.NOTE),
        *_failsafes(flight, seen, judged.vehicle),
    ]
    if elsewhere:
        found = [_overruled(each, _PLACE, "--elsewhere") for each in found]
    if untimed:
        found = [_overruled(each, _TIMING, "--untimed") for each in found]
    return tuple(sorted(found, key=lambda each: _ORDER[each.level]))


def _error(rule: str, message: str, action: str) -> Finding:
    return Finding(Level.ERROR, rule, None, message, action)


def _warning(rule: str, message: str, action: str) -> Finding:
    return Finding(Level.WARNING, rule, None, message, action)


def _note(rule: str, message: str) -> Finding:
    return Finding(Level.NOTE, rule, None, message, "")


def _overruled(found: Finding, rules: str, option: str) -> Finding:
    """Return what was `found`; an error by one of the `rules` as a warning that names `option`."""
    if found.level is not Level.ERROR or not found.rule.startswith(rules):
        return found
    return replace(found, level=Level.WARNING, action=f"{option}: flown all the same")


def _judged(flight: Flight, seen: Seen, *, elsewhere: bool) -> Check:
    """Return what validation says of the mission, from where it stands, with what it holds."""
    mission, values = seen.held.beside(flight.placed, seen.vehicle), seen.held.reading.values
    if seen.place is not None and (elsewhere or Whereabouts.of(seen.place, mission).is_meant):
        mission = replace(mission, home=seen.place)
    own, kind = seen.vehicle.family.key, seen.vehicle.kind
    vehicle = replace(
        flight.vehicle, autopilot=own, kind=kind, parameters=values, source="the vehicle"
    ).usable()
    if flight.solution is None:
        return check(mission, vehicle)
    limits = Limits(max_speed=flight.solution.plan.vehicle.max_speed)
    found = check(mission, vehicle, limits=limits, solution=flight.solution)
    if not flight.streamed:
        return found
    kept = tuple(each for each in found.findings if not _of_the_mission(each))
    return replace(found, findings=kept)


def _of_the_mission(found: Finding) -> bool:
    """Tell whether it is about how a mission keeps its plan, which a stream does by setpoints."""
    late = found.rule.startswith("link-") and found.level is Level.WARNING
    return late or found.rule == "speed-above-limit"


def _state(flight: Flight, seen: Seen) -> Iterator[Finding]:
    if seen.armed:
        yield _error("armed", "it is armed already", "disarm it, or watch it without --arm")
    if seen.stations:
        yield _error(
            "ground-station",
            f"another ground station is on the link ({'; '.join(sorted(seen.stations))})",
            "close it, or let it start the mission",
        )
    if not flight.streamed and seen.mode in seen.vehicle.modes.not_to_arm_in:
        yield _error(
            "mode",
            f"it is in mode {seen.mode_name}, in which it is not armed, or flies as soon as it is",
            "set the mode in which the pilot is to take over",
        )


def _place(flight: Flight, seen: Seen) -> Iterator[Finding]:
    place, mission = seen.place, flight.placed
    if place is None:
        yield _error(
            "position-unknown",
            "it does not tell where it stands",
            "wait until it has a position, under open sky",
        )
        return
    stands, carry = Whereabouts.of(place, mission), "carry it there, or make a mission for here"
    if stands.from_home is not None and not stands.from_home <= HOME_AWAY:
        yield _error(
            "place-home",
            f"it stands {shown(stands.from_home)} from the mission's home, not within "
            f"{HOME_AWAY:g} m",
            f"{carry}; --elsewhere flies it from here",
        )
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
        yield _warning(
            "place-height-unknown",
            "the mission does not tell how high its home is: it may be made for another height",
            "give the home its height above sea level",
        )
    first, no_home = stands.from_first, stands.from_home is None
    if first is not None and not first <= FIRST_AWAY:
        message = f"the mission's first place is {shown(first)} from where it stands"
        told = _error if no_home or not first <= FIRST_FARTHEST else _warning
        yield told("place-first", message, f"{carry}; --elsewhere flies it from here")
    home = seen.held.home
    if home is not None and not distance(place, (home.latitude, home.longitude)) <= HOME_AWAY:
        away = distance(place, (home.latitude, home.longitude))
        yield _warning(
            "returns-elsewhere",
            f"its own home, where it returns to, is {shown(away)} from where it stands",
            "set its home here with the ground station, unless that is meant",
        )


def _lists(flight: Flight, seen: Seen, own: Vehicle) -> Iterator[Finding]:
    """Yield where what it holds is not what the file has, no more and no less."""
    for part in MissionType:
        rule = f"holds-{part.name.lower()}"
        wanted = wire_items(flight.mission, part, seen.vehicle)
        held = seen.held.rows(part, seen.vehicle)
        if part in seen.held.missing:
            yield _error(rule, f"{part.title}: what it holds cannot be read", "try again")
        elif wanted:
            found = compare(wanted, seen.held.lists.get(part, ()), part, seen.vehicle)
            wrong = [each for each in found if each.kind == "wrong"]
            if wrong:
                yield _error(rule, f"it holds another one: {wrong[0]}", "upload it again")
        elif held:
            idle = part is MissionType.FENCE and own.type.at_fence(own).action == "nothing"
            told = _warning if idle else _error
            what = "a fence" if part is MissionType.FENCE else part.title
            message = f"it holds {what} ({counted(len(held), 'item')}) that the file has not"
            yield told(
                rule,
                f"{message}, and does nothing about it" if idle else message,
                "take that into the file (download), or remove it (upload --clear-rest)",
            )


def _timing(flight: Flight, seen: Seen, judged: Check) -> Iterator[Finding]:
    """Yield where its parameters are not those that the mission is timed for."""
    given, values = flight.vehicle.parameters, seen.held.reading.values
    other, unread, assumed = list[str](), list[str](), list[str]()
    for parameter in seen.vehicle.parameters.values():
        timed = parameter.motion and parameter.name_in(given) is not None
        name = next((each for each in parameter.names if each in values), None)
        if name is None:
            (unread if timed else assumed).append(" or ".join(parameter.names))
        if name is None or not timed:
            continue
        wanted = number_in(parameter, name, given)
        if wanted is not None and not close(values[name], wanted):
            other.append(f"{name} is {values[name]:g}, not {wanted:g}")
    # Setpoints come when they are due, whatever the mission's time is.
    told = _warning if flight.streamed else _error
    action = "set them (upload --parameters FILE), or --untimed flies it late or early"
    if other:
        message = f"other parameters than the mission is timed for: {', '.join(other)}"
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
    if judged.track is None:
        return ""
    own = replace(judged.vehicle, parameters=flight.vehicle.parameters).usable()
    meant = check(judged.mission, own, wind=judged.wind).track
    if meant is None:
        return ""
    return f"; predicted to take {judged.track.t[-1]:.1f} s, not {meant.t[-1]:.1f} s"


def _battery(seen: Seen, judged: Check) -> Iterator[Finding]:
    energy, percent = judged.energy, seen.battery
    if percent is None:
        yield _warning(
            "battery-unknown", "it does not tell its battery", "see to it that the battery is full"
        )
        return
    least, why = float(LEAST_BATTERY), "where no plan tells what the flight takes"
    if energy is not None and energy.battery is not None:
        battery = energy.battery
        takes = 100 * energy.total / battery.capacity_wh
        least = takes + battery.reserve
        why = f"the flight takes {takes:.0f} %, and is to leave {battery.reserve:g} %"
    if percent < least:
        message = f"its battery is at {percent} %, which is below {least:.0f} %: {why}"
        yield _error("battery-low", message, "change the battery")


def _failsafes(flight: Flight, seen: Seen, own: Vehicle) -> Iterator[Finding]:
    """Yield what it does by itself on a loss, one line each."""
    values = seen.held.reading.values
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
    if seen.held.rows(MissionType.FENCE, seen.vehicle):
        response = own.type.at_fence(own)
        name = own.name_of(response.parameter)
        message = f"fence left: it {_AT_FENCE[response.action]} ({name})"
        if response.keeps:
            yield _note("on-fence-left", message)
        else:
            yield _warning("on-fence-left", message, f"set {name} {response.set_to}")
    height = own.vertical.return_height
    if height > 0 and "return_height" in own.type.parameters:
        name = own.name_of("return_height")
        yield _note("on-return", f"a return is flown {height:g} m above home at least ({name})")
