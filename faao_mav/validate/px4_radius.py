"""Acceptance radii with which PX4 does not fly a mission as it looks."""

import math
from collections.abc import Iterator
from itertools import pairwise

from faao_mav.mission.command import Command
from faao_mav.validate.context import ValidationContext, number
from faao_mav.validate.rule import Issue, Rules
from faao_mav.validate.straight import HOME, Straight
from faao_mav.vehicle import PX4_COPTER

RULES = Rules(PX4_COPTER.family)

_MEASURED = "measured on PX4 1.16.1"

_SMALLEST = 1.0
"""The radius, m, below which an aircraft may miss it. Measured: it is off by up to 0.5 m."""

_NARROWER = 0.5
"""How much smaller, m, the next radius may be: the aircraft flies on that far while it switches."""

_STRAIGHT = math.radians(5)
"""The turn up to which the way back to a waypoint is no detour, rad. Chosen."""


def _radii(context: ValidationContext) -> Iterator[tuple[Straight, float]]:
    """Yield each leg to a waypoint, with the acceptance radius there, m."""
    default = context.vehicle.value("acceptance_radius")
    for leg in context.legs:
        item = context.items[leg.index]
        if item.command == Command.NAV_WAYPOINT and not leg.jump:
            yield leg, item.params[1] if item.params[1] > 0 else default


@RULES.warning(
    "px4-radius-covers-leg",
    "an acceptance radius as long as its leg: the waypoint counts at once",
    _MEASURED,
)
def _covers(context: ValidationContext) -> Iterator[Issue]:
    for leg, radius in _radii(context):
        held = context.items[leg.index].params[0] > 0  # it is held at all the same
        if leg.start.index != HOME and 0.05 <= leg.length <= radius and not held:
            yield Issue(
                leg.index,
                f"the leg is {leg.length:.1f} m long, the acceptance radius {radius:g} m: the "
                "waypoint counts as reached at once",
                "use a smaller radius (param2, NAV_ACC_RAD) or a longer leg",
            )


@RULES.warning(
    "px4-radius-small",
    "an acceptance radius that the aircraft may miss for minutes",
    f"{_MEASURED}: 0.05 m held it for 53 s, 0.1 m for 124 s, 0.3 m for 6 s",
    kind="copter",
)
def _small(context: ValidationContext) -> Iterator[Issue]:
    for leg, radius in _radii(context):
        if radius < _SMALLEST:
            yield Issue(
                leg.index,
                f"an acceptance radius of {radius:g} m: the aircraft is seldom that close and may "
                "wait at the waypoint for minutes",
                f"use {_SMALLEST:g} m or more (param2, NAV_ACC_RAD)",
            )


@RULES.warning(
    "px4-radius-narrows",
    "a radius wider than the next one in a corner: the aircraft first flies back to the waypoint",
    f"{_MEASURED}; PX4 1.16 FlightTaskAuto",
    kind="copter",
)
def _narrows(context: ValidationContext) -> Iterator[Issue]:
    for (leg, radius), (onward, smaller) in pairwise(_radii(context)):
        if leg.end is not onward.start or context.items[leg.index].params[0] > 0:
            continue
        if radius > smaller + _NARROWER and _turn(leg, onward) > _STRAIGHT:
            yield Issue(
                leg.index,
                f"left {radius:g} m before it for item {number(onward.index)}, whose radius is "
                f"{smaller:g} m: the aircraft slows down and first flies to the waypoint",
                f"use the same radius for both, {smaller:g} m here or {radius:g} m there",
            )


def _turn(leg: Straight, onward: Straight) -> float:
    """Return the turn from one leg to the next, rad, 0 to pi; 0 where one has no direction."""
    before, after = (
        complex(each.end.east - each.start.east, each.end.north - each.start.north)
        for each in (leg, onward)
    )
    across = after * before.conjugate()
    return abs(math.atan2(across.imag, across.real))
