"""How high, how far and how long the mission goes."""

import math

import numpy as np

from faao_mav.mission.command import HOLDING, LANDINGS, TAKEOFFS, Command
from faao_mav.power import JOULES_PER_WH
from faao_mav.validate.context import HOME, ValidationContext
from faao_mav.validate.rule import Hits, checks, hit, threshold


@checks
def _beyond(context: ValidationContext) -> Hits:
    """Places beyond the limits that were given, those of the vehicle's own fence, and any sense."""
    value, limits, high = context.value, context.limits, context.vehicle.fence_heights[1]
    kinds = int(value("fence_type", 0)) if value("fence_enable", 0.0) != 0 else 0
    radius = value("fence_radius") if kinds & 2 else math.inf
    farthest = value("fence_distance") if value("fence_distance") > 0 else math.inf
    for place in context.places:
        away = place.from_origin if context.home is not None else 0.0
        for rule, reached, limit in (
            ("too-high", place.up, threshold.highest),
            ("above-ceiling", place.up, limits.max_altitude or math.inf),
            ("beyond-distance", away, limits.max_distance or math.inf),
            ("ardupilot-fence-ceiling", place.up, high),
            ("ardupilot-fence-circle", away, radius),
            ("px4-max-vertical", place.up, high),
            ("px4-max-horizontal", away, farthest),
        ):
            if reached > limit:
                yield hit(rule, place.index, place=place, limit=limit)


@checks
def _heights(context: ValidationContext) -> Hits:
    """Places that are too low, or higher than many countries allow, and the height of a return."""
    ceiling, floor = context.limits.max_altitude, context.vehicle.fence_heights[0]
    for place in context.places:
        command = context.items[place.index].command
        if place.up < 0 and command not in LANDINGS | TAKEOFFS:
            yield hit("below-home", place.index, below=-place.up)
        elif place.up < threshold.least_height and command not in LANDINGS:
            yield hit("near-ground", place.index, place=place)
        if place.up < floor and command != Command.NAV_LAND:
            yield hit("ardupilot-fence-floor", place.index, place=place, limit=floor)
    height, name = context.parameter("return_height")
    if ceiling is not None and height > ceiling:
        newest = context.vehicle.type.parameters["return_height"].newest_name
        yield hit("return-above-ceiling", height=height, name=name, newest=newest)
    above = (
        place for place in context.places if place.up > threshold.common_ceiling and ceiling is None
    )
    if (highest := max(above, key=lambda place: place.up, default=None)) is not None:
        yield hit("above-120-m", highest.index, place=highest)


@checks
def _distances(context: ValidationContext) -> Hits:
    """How far the places are from home, and from each other."""
    home, hovers, far = context.mission.home, context.vehicle.type.hovers, 1000 * threshold.far
    farthest = 1000 * (threshold.farthest_copter if hovers else threshold.farthest_plane)
    for place in context.places if home is not None else ():
        away, item = place.from_origin, context.items[place.index]
        if home is not None and away > farthest:
            off = math.hypot(item.x - home.longitude, item.y - home.latitude)
            slip = "latitude and longitude look exchanged: correct them"
            slip = slip if off < threshold.swapped else "correct it"
            yield hit("too-far", place.index, away=away / 1000, slip=slip)
        elif context.limits.max_distance is None and away > far:
            yield hit("far-from-home", place.index, away=away / 1000)
    for leg in context.legs:
        near = max(leg.start.from_origin, leg.end.from_origin) <= farthest
        if near and leg.length > far and HOME not in (leg.start.index, leg.end.index):
            yield hit("long-leg", leg.index, leg=leg, length=leg.length / 1000)


@checks
def _predicted(context: ValidationContext) -> Hits:
    """How far the predicted flight goes."""
    track, limits = context.track, context.limits
    if track is None:
        return
    away = np.abs(context.flown) * (context.home is not None)
    for limit, flown, what in (
        (limits.max_altitude, track.position[:, 2], "m above home; --max-altitude"),
        (limits.max_distance, away, "m from home; --max-distance"),
        (limits.max_duration, track.t, "s long; --max-duration"),
    ):
        worst = int(np.argmax(flown))
        if limit is not None and flown[worst] > limit + threshold.wobble:
            told = {"worst": flown[worst], "what": what, "limit": limit}
            yield hit("predicted-beyond", int(track.item[worst]), **told)


@checks
def _duration(context: ValidationContext) -> Hits:
    """How long the flight lasts, and what it takes of a battery."""
    least, energy = _least_duration(context), context.energy
    if least > (context.limits.max_duration or math.inf):
        yield hit("too-long", least=least)
    if energy is None or energy.battery is None:
        return
    for rule, takes in (
        ("battery-reserve", least * energy.least_power / JOULES_PER_WH),
        ("battery-tight", energy.total),
    ):
        if takes > energy.battery.usable:
            yield hit(rule, takes=takes, battery=energy.battery)


def _least_duration(context: ValidationContext) -> float:
    """Return what legs and circles at the commanded speeds and the holds take, s, without ramps.

    It is no more than what is predicted: an aeroplane's tail wind and thin air make it quicker.
    Jumps are not followed; circles without end are left out.
    """
    climb, track = context.vehicle.value("climb_speed"), context.track
    flying = 0.0
    for leg in (leg for leg in context.legs if not leg.jump):
        up = leg.rise / climb if leg.rise > 0 and climb > 0 else 0.0
        flying += max(leg.length / leg.speed if leg.speed > 0 else 0.0, up)
    holds = (
        item.params[0]
        for k, item in context.each(*HOLDING, Command.NAV_DELAY)
        if k not in context.orbits
    )
    waiting = sum(hold for hold in holds if hold > 0)
    orbits = ((k, orbit) for k, orbit in context.orbits.items() if not orbit.endless)
    circling = sum(orbit.lasting(context.speeds[k]) for k, orbit in orbits)
    predicted = float(track.t[-1]) if track is not None else math.inf
    return min(flying + waiting + circling, predicted)
