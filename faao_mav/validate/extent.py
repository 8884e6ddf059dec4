"""How high, how far and how long the mission goes."""

import math

import numpy as np

from faao_mav.mission.command import ABOVE_HOME, LANDINGS, TAKEOFFS, Command
from faao_mav.plan.energy import Battery
from faao_mav.power import JOULES_PER_WH
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.rule import Checks, Hits, at
from faao_mav.validate.straight import HOME, PlacedItem, Straight

checks = Checks()

FAR = 10.0
"""The distance from home or from item to item, km, that is hardly meant. Chosen."""

COMMON_CEILING = 120.0
"""The height, m above ground, that many countries allow without a permission."""

LEAST_HEIGHT = 1.0
"""The height, m above home, below which an item is about the ground: the estimate of the height is
no better. Chosen."""

HIGHEST = 20_000.0
"""The height, m above home, that no vehicle here reaches; plans end there too. Chosen."""

_WOBBLE = 1.0
"""By how much, m or s, the predicted flight may exceed a limit: aircraft wobble. Chosen."""

_SWAPPED = 1.0
"""Degrees from home within which a place lies if its exchanged coordinates are the slip. Chosen."""

_FARTHEST = {True: 100.0, False: 1_000.0}
"""Kilometres from home that no copter, and no plane, flies to. Chosen: twice what they do in the
hours that flights are predicted."""

_HOLDS = (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT, Command.NAV_LOITER_TIME)
_DELAYS = (*_HOLDS, Command.NAV_DELAY)


@checks("below-home")
def _(context: ValidationContext) -> Hits:
    for place in context.places:
        if place.up < 0 and context.items[place.index].command not in LANDINGS | TAKEOFFS:
            yield at(place.index, below=-place.up, **_raised(context, place))


@checks("near-ground")
def _(context: ValidationContext) -> Hits:
    for place in context.places:
        command = context.items[place.index].command
        meant = command in LANDINGS or (place.up < 0 and command not in TAKEOFFS)
        if place.up < LEAST_HEIGHT and not meant:
            yield at(place.index, place=place, **_raised(context, place))


def _raised(context: ValidationContext, place: PlacedItem) -> dict[str, str]:
    """Return what to do about a height, and what it is above the sea if it counts from there."""
    item, home = context.items[place.index], context.mission.home
    if item.frame in ABOVE_HOME or home is None:
        return {"sea": "", "instead": "raise the item, unless the ground there is lower than home"}
    sea = f"{item.z:g} m above sea level, where home is at {home.altitude:g} m: "
    return {"sea": sea, "instead": "use frame 3, height above home, or raise the item"}


@checks("too-far")
def _(context: ValidationContext) -> Hits:
    home, farthest = context.mission.home, _FARTHEST[context.vehicle.type.hovers]
    for place in context.places:
        away, item = place.from_origin / 1000, context.items[place.index]
        if home is not None and away > farthest:
            swapped = math.hypot(item.x - home.longitude, item.y - home.latitude) < _SWAPPED
            slip = "latitude and longitude look exchanged: correct them"
            yield at(place.index, away=away, slip=slip if swapped else "correct it")


@checks("too-high")
def _(context: ValidationContext) -> Hits:
    return _above(context, HIGHEST)


@checks("above-ceiling")
def _(context: ValidationContext) -> Hits:
    return _above(context, context.limits.max_altitude)


@checks("beyond-distance")
def _(context: ValidationContext) -> Hits:
    return _beyond(context, context.limits.max_distance)


def _above(context: ValidationContext, limit: float | None) -> Hits:
    most = math.inf if limit is None else limit
    return (at(p.index, place=p, limit=limit) for p in context.places if p.up > most)


def _beyond(context: ValidationContext, limit: float | None) -> Hits:
    most = math.inf if limit is None or context.home is None else limit
    return (at(p.index, place=p, limit=limit) for p in context.places if p.from_origin > most)


def _fenced(context: ValidationContext, key: str, bit: int) -> float | None:
    """Return the bound `key`, m, if FENCE_ENABLE and the `bit` of FENCE_TYPE switch it on."""
    value = context.vehicle.value
    on = value("fence_enable") != 0 and int(value("fence_type")) & bit
    return value(key) if on else None


@checks("ardupilot-fence-ceiling")
def _(context: ValidationContext) -> Hits:
    return _above(context, _fenced(context, "fence_ceiling", bit=1))


@checks("ardupilot-fence-floor")
def _(context: ValidationContext) -> Hits:
    limit = _fenced(context, "fence_floor", bit=8)
    for place in context.places if limit is not None else ():
        lands = context.items[place.index].command == Command.NAV_LAND
        if not lands and place.up < (limit or 0.0):
            yield at(place.index, place=place, limit=limit)


@checks("ardupilot-fence-circle")
def _(context: ValidationContext) -> Hits:
    return _beyond(context, _fenced(context, "fence_radius", bit=2))


@checks("px4-max-horizontal")
def _(context: ValidationContext) -> Hits:
    return _beyond(context, max(context.vehicle.value("fence_distance"), 0.0) or None)


@checks("px4-max-vertical")
def _(context: ValidationContext) -> Hits:
    return _above(context, max(context.vehicle.value("fence_height"), 0.0) or None)


@checks("predicted-beyond")
def _(context: ValidationContext) -> Hits:
    track, positions, limits = context.track, context.track_positions, context.limits
    if track is None or positions is None or not len(track.t):
        return
    away = np.hypot(*positions[:, :2].T) * (context.home is not None)
    for limit, flown, what in (
        (limits.max_altitude, track.position[:, 2], "m above home; --max-altitude"),
        (limits.max_distance, away, "m from home; --max-distance"),
        (limits.max_duration, track.t, "s long; --max-duration"),
    ):
        worst = int(np.argmax(flown))
        if limit is not None and flown[worst] > limit + _WOBBLE:
            yield at(int(track.item[worst]), worst=flown[worst], what=what, limit=limit)


@checks("above-120-m")
def _(context: ValidationContext) -> Hits:
    high = [place for place in context.places if place.up > COMMON_CEILING]
    if high and context.limits.max_altitude is None:
        top = max(high, key=lambda place: place.up)
        yield at(top.index, place=top)


@checks("return-above-ceiling")
def _(context: ValidationContext) -> Hits:
    ceiling, (height, name) = context.limits.max_altitude, context.parameter("return_height")
    newest = context.vehicle.type.parameters["return_height"].newest_name
    if ceiling is not None and height > ceiling:
        yield at(height=height, name=name, ceiling=ceiling, newest=newest)


@checks("far-from-home")
def _(context: ValidationContext) -> Hits:
    if context.home is not None and context.limits.max_distance is None:
        for place in context.places:
            if FAR < place.from_origin / 1000 <= _FARTHEST[context.vehicle.type.hovers]:
                yield at(place.index, away=place.from_origin / 1000)


@checks("long-leg")
def _(context: ValidationContext) -> Hits:
    farthest = 1000 * _FARTHEST[context.vehicle.type.hovers]
    for leg in context.legs:
        near = max(leg.start.from_origin, leg.end.from_origin) <= farthest
        if leg.length > 1000 * FAR and near and HOME not in (leg.start.index, leg.end.index):
            yield at(leg.index, leg=leg, length=leg.length / 1000)


@checks("too-long")
def _(context: ValidationContext) -> Hits:
    limit = context.limits.max_duration
    if limit is not None and (least := least_duration(context)) > limit:
        yield at(least=least, limit=limit)


@checks("battery-reserve")
def _(context: ValidationContext) -> Hits:
    if (energy := context.energy) is not None:
        least = least_duration(context) * energy.least_power / JOULES_PER_WH
        yield from _short(energy.battery, least)


@checks("battery-tight")
def _(context: ValidationContext) -> Hits:
    energy = context.energy
    return _short(energy.battery, energy.total) if energy is not None else ()


def _short(battery: Battery | None, takes: float) -> Hits:
    """Tell of a flight that `takes` so many Wh and leaves less than the reserve."""
    if battery is not None and takes > battery.usable:
        yield at(takes=takes, battery=battery)


def least_duration(context: ValidationContext) -> float:
    """Return what legs and circles at the commanded speeds and the holds take, s, without ramps.

    It is no more than what is predicted: an aeroplane's tail wind and thin air make it quicker.
    Jumps are not followed; circles without end are left out.
    """
    climb, track = context.vehicle.value("climb_speed"), context.track
    flying = sum(_leg_duration(leg, climb) for leg in context.legs if not leg.jump)
    holds = (item.params[0] for k, item in context.each(*_DELAYS) if k not in context.orbits)
    waiting = sum(hold for hold in holds if hold > 0)
    circling = sum(
        orbit.lasting(context.speeds[k]) for k, orbit in context.orbits.items() if not orbit.endless
    )
    predicted = float(track.t[-1]) if track is not None and len(track.t) else math.inf
    return min(flying + waiting + circling, predicted)


def _leg_duration(leg: Straight, climb: float) -> float:
    up = leg.rise / climb if leg.rise > 0 and climb > 0 else 0.0
    return max(leg.length / leg.speed if leg.speed > 0 else 0.0, up)
