"""How high, how far and how long the mission goes."""

import math
from collections.abc import Iterator

import numpy as np

from faao_mav.mission.command import ABOVE_HOME, LANDINGS, TAKEOFFS, Command
from faao_mav.plan.energy import Battery
from faao_mav.power import JOULES_PER_WH
from faao_mav.validate.context import ValidationContext, number
from faao_mav.validate.rule import Issue, Rules
from faao_mav.validate.straight import HOME, PlacedItem, Straight

RULES = Rules()

FAR = 10_000.0
"""The distance from home or from item to item, m, that is hardly meant. Chosen."""

COMMON_CEILING = 120.0
"""The height, m above ground, that many countries allow without a permission."""

LEAST_HEIGHT = 1.0
"""The height, m above home, below which an item is about the ground: the estimate of the height is
no better. Chosen."""

HIGHEST = 20_000.0
"""The height, m above home, that no vehicle here reaches; plans end there too. Chosen."""

_WOBBLE = 1.0
"""By how much, m or s, the predicted flight may exceed a limit: aircraft wobble. Chosen."""

_GIVEN = "the limit that was given"
_CEILING, _RANGE = "m above home; --max-altitude is", "m from home; --max-distance is"
_CHANGE = "change the item, or raise the limit if you may"
_HOLDS = (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT, Command.NAV_LOITER_TIME)
_DELAYS = (*_HOLDS, Command.NAV_DELAY)


@RULES.error(
    "below-home",
    "measured on ArduCopter and ArduPlane 4.7: on the ground, armed; on PX4 1.16.1: the same",
)
def _below_home(context: ValidationContext) -> Iterator[Issue]:
    """An item below home: on level ground the aircraft flies into it."""
    for place in context.places:
        if place.up < 0 and context.items[place.index].command not in LANDINGS | TAKEOFFS:
            yield _too_low(context, place, f"{-place.up:g} m below home")


@RULES.warning(
    "near-ground",
    "measured on ArduCopter 4.7 and PX4 1.16.1",
    summary=f"an item less than {LEAST_HEIGHT:g} m above home",
)
def _near_ground(context: ValidationContext) -> Iterator[Issue]:
    for place in context.places:
        command = context.items[place.index].command
        if command in LANDINGS or (place.up < 0 and command not in TAKEOFFS):
            continue
        if place.up < LEAST_HEIGHT:
            yield _too_low(context, place, f"{place.up:g} m above home")


def _too_low(context: ValidationContext, place: PlacedItem, how: str) -> Issue:
    item, home = context.items[place.index], context.mission.home
    if item.frame in ABOVE_HOME or home is None:
        return Issue(place.index, how, "raise the item, unless the ground there is lower than home")
    sea = f"{item.z:g} m above sea level, where home is at {home.altitude:g} m: "
    return Issue(place.index, sea + how, "use frame 3, height above home, or raise the item")


_SWAPPED = 1.0
"""Degrees from home within which a place lies if its exchanged coordinates are the slip. Chosen."""

_FARTHEST = {True: 100.0, False: 1_000.0}
"""Kilometres from home that no copter, and no plane, flies to. Chosen: twice what they do in the
hours that flights are predicted."""


@RULES.error("too-far", "common sense", summary="farther from home than any vehicle of its kind")
def _too_far(context: ValidationContext) -> Iterator[Issue]:
    for place in context.places:
        away = place.from_origin / 1000
        if context.home is None or away <= _FARTHEST[context.vehicle.type.hovers]:
            continue
        item, home = context.items[place.index], context.mission.home
        assert home is not None
        swapped = math.hypot(item.x - home.longitude, item.y - home.latitude) < _SWAPPED
        slip = "latitude and longitude look exchanged: correct them" if swapped else "correct it"
        yield Issue(place.index, f"its place is {away:,.0f} km from home", slip)


@RULES.error("too-high", "common sense", summary=f"higher than {HIGHEST / 1000:g} km above home")
def _too_high(context: ValidationContext) -> Iterator[Issue]:
    for place in context.places:
        if place.up > HIGHEST:
            yield Issue(
                place.index,
                f"{place.up / 1000:g} km above home: no aircraft of this kind gets there",
                "correct the height; it counts in metres",
            )


@RULES.error("above-ceiling", _GIVEN)
def _above_ceiling(context: ValidationContext) -> Iterator[Issue]:
    """An item higher than the ceiling that was set."""
    limit = context.limits.max_altitude
    for place in context.places:
        if limit is not None and place.up > limit:
            yield Issue(place.index, f"{place.up:.6g} {_CEILING} {limit:g} m", _CHANGE)


@RULES.error("beyond-distance", _GIVEN)
def _beyond(context: ValidationContext) -> Iterator[Issue]:
    """An item farther from home than was set."""
    limit = context.limits.max_distance
    for place in context.places:
        if limit is not None and context.home is not None and place.from_origin > limit:
            yield Issue(place.index, f"{place.from_origin:.6g} {_RANGE} {limit:g} m", _CHANGE)


@RULES.warning("predicted-beyond", f"{_GIVEN}; predicted flight")
def _predicted_beyond(context: ValidationContext) -> Iterator[Issue]:
    """The predicted flight goes higher, farther or on for longer than was set."""
    track, positions, limits = context.track, context.track_positions, context.limits
    if track is None or positions is None or not len(track.t):
        return
    away = np.hypot(*positions[:, :2].T) * (context.home is not None)
    for limit, flown, shown in (
        (limits.max_altitude, track.position[:, 2], _CEILING),
        (limits.max_distance, away, _RANGE),
        (limits.max_duration, track.t, "s long; --max-duration is"),
    ):
        worst = int(np.argmax(flown))
        if limit is not None and flown[worst] > limit + _WOBBLE:
            told = f"the predicted flight gets {flown[worst]:.1f} {shown} {limit:g}"
            yield Issue(int(track.item[worst]), told, _CHANGE)


@RULES.note(
    "above-120-m",
    "EU 2019/947 (open category), FAA part 107 (400 ft)",
    summary=f"higher than {COMMON_CEILING:g} m above home, what many countries allow",
)
def _above_common(context: ValidationContext) -> Iterator[Issue]:
    high = [place for place in context.places if place.up > COMMON_CEILING]
    if high and context.limits.max_altitude is None:
        top = max(high, key=lambda place: place.up)
        yield Issue(
            top.index,
            f"{top.up:g} m above home; many countries allow {COMMON_CEILING:g} m above ground",
            "make sure that you may; --max-altitude sets your ceiling",
        )


@RULES.warning("return-above-ceiling", "RTL_ALT, RTL_ALTITUDE (ArduPilot), RTL_RETURN_ALT (PX4)")
def _return_above(context: ValidationContext) -> Iterator[Issue]:
    """On a return to launch the aircraft climbs above the ceiling that was set."""
    ceiling = context.limits.max_altitude
    vehicle = context.vehicle
    height, name = vehicle.value("return_height"), vehicle.name_of("return_height")
    newest = vehicle.type.parameters["return_height"].newest_name
    if ceiling is not None and height > ceiling:
        yield Issue(
            None,
            f"a return to launch, also after a failure, goes up to {height:g} m "
            f"({name}); the ceiling is {ceiling:g} m",
            f"set {newest} to {ceiling:g} m or less",
        )


@RULES.warning("far-from-home", "common sense", summary=f"farther than {FAR / 1000:g} km from home")
def _far(context: ValidationContext) -> Iterator[Issue]:
    if context.home is None or context.limits.max_distance is not None:
        return
    for place in context.places:
        distance = place.from_origin
        if FAR < distance <= 1000 * _FARTHEST[context.vehicle.type.hovers]:
            yield Issue(
                place.index,
                f"{distance / 1000:.1f} km from home",
                "check the coordinates and home; --max-distance sets your limit",
            )


@RULES.warning("long-leg", "common sense", summary=f"a leg of more than {FAR / 1000:g} km")
def _long(context: ValidationContext) -> Iterator[Issue]:
    for leg in context.legs:
        near = (
            max(leg.start.from_origin, leg.end.from_origin)
            <= 1000 * _FARTHEST[context.vehicle.type.hovers]
        )
        if leg.length > FAR and near and leg.start.index != HOME and leg.end.index != HOME:
            yield Issue(
                leg.index,
                f"{leg.length / 1000:.1f} km from item {number(leg.start.index)} to item "
                f"{number(leg.end.index)}",
                "check the coordinates",
            )


@RULES.error("too-long", f"{_GIVEN}; the commanded speeds")
def _too_long(context: ValidationContext) -> Iterator[Issue]:
    """The flight takes longer than was set, whatever the aircraft."""
    limit = context.limits.max_duration
    if limit is not None and (least := least_duration(context)) > limit:
        yield Issue(
            None,
            f"the flight takes at least {least:.0f} s; the limit is {limit:g} s",
            "shorten the mission, or raise --max-duration",
        )


@RULES.error("battery-reserve", "the plan's vehicle.power and vehicle.battery; commanded speeds")
def _reserve(context: ValidationContext) -> Iterator[Issue]:
    """The flight leaves less than the reserve of the plan's battery, whatever the aircraft."""
    if (energy := context.energy) is not None:
        least = least_duration(context) * energy.least_power / JOULES_PER_WH
        yield from _short(energy.battery, "takes at least", least)


@RULES.warning("battery-tight", "the plan's vehicle.power and vehicle.battery; predicted flight")
def _tight(context: ValidationContext) -> Iterator[Issue]:
    """The flight is predicted to leave less than the reserve of the plan's battery."""
    if context.energy is not None:
        yield from _short(context.energy.battery, "is predicted to take", context.energy.total)


def _short(battery: Battery | None, takes: str, watt_hours: float) -> Iterator[Issue]:
    """Yield that a flight which `takes` so many Wh leaves less than the reserve, if it does."""
    if battery is not None and watt_hours > battery.usable:
        yield Issue(
            None,
            f"the flight {takes} {watt_hours:.4g} Wh; of {battery.capacity_wh:g} Wh "
            f"{battery.usable:.4g} are above the reserve of {battery.reserve:g} %",
            "plan with less flight.duration or a nearer start and end, or give a larger battery",
        )


def least_duration(context: ValidationContext) -> float:
    """Return what legs and circles at the commanded speeds and the holds take, s, without ramps.

    It is no more than what is predicted: an aeroplane's tail wind and thin air make it quicker.
    Jumps are not followed; circles without end are left out.
    """
    climb, track = context.vehicle.value("climb_speed"), context.track
    flying = sum(_leg_duration(leg, climb) for leg in context.legs if not leg.jump)
    waiting = sum(
        item.params[0]
        for k, item in context.each(*_DELAYS)
        if item.params[0] > 0 and k not in context.orbits
    )
    circling = sum(
        orbit.lasting(context.speeds[k]) for k, orbit in context.orbits.items() if not orbit.endless
    )
    predicted = float(track.t[-1]) if track is not None and len(track.t) else math.inf
    return min(flying + waiting + circling, predicted)


def _leg_duration(leg: Straight, climb: float) -> float:
    up = leg.rise / climb if leg.rise > 0 and climb > 0 else 0.0
    return max(leg.length / leg.speed if leg.speed > 0 else 0.0, up)
