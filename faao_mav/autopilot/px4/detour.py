"""Where PX4 heads on a leg: to its end, or first to its beginning or back onto it.

Which of these is decided by where the aircraft is, with the acceptance radius of the leg's end for
a tolerance. So an aircraft that enters a leg far from it, for the waypoint before was accepted from
afar and this one has a small radius, first flies to that waypoint. Source: behaviour of PX4's
FlightTaskAuto.
"""

from dataclasses import replace
from enum import Enum, auto

from faao_mav.autopilot.px4.guidance import GuidedLeg, stopping_speed
from faao_mav.autopilot.px4.parameters import Px4Limits


class Heading(Enum):
    """What an aircraft on a leg heads for.

    That is the leg's `END`, the end although it is `PAST` it, the `BEGINNING`, or the nearest point
    of the leg, to get `ONTO` it.
    """

    END = auto()
    PAST = auto()
    BEGINNING = auto()
    ONTO = auto()


def heading(leg: GuidedLeg, place: complex) -> Heading:
    """Return what an aircraft at `place`, m, heads for."""
    way = (place - leg.origin) * leg.along.conjugate()
    if way.real > leg.length:
        return Heading.PAST
    if way.real < 0 and abs(way) > leg.radius:
        return Heading.BEGINNING
    if abs(way.imag) > leg.radius:
        return Heading.ONTO
    return Heading.END


def excess(kind: Heading, leg: GuidedLeg, place: complex) -> float:
    """Return how deep, m, an aircraft at `place` is in where it heads for `kind` if nothing else.

    Above 0 it is there, and below outside. `kind` is not the leg's end.
    """
    way = (place - leg.origin) * leg.along.conjugate()
    if kind is Heading.PAST:
        return way.real - leg.length
    if kind is Heading.BEGINNING:
        return min(-way.real, abs(way) - leg.radius)
    return abs(way.imag) - leg.radius


def headed(limits: Px4Limits, leg: GuidedLeg, kind: Heading, place: complex) -> GuidedLeg:
    """Return the leg that PX4 makes of `leg` for an aircraft at `place`, m, that heads for `kind`.

    The leg that it makes begins at the aircraft. On a detour the leg's end is the waypoint after
    the target, and nothing is known of what follows.
    """
    if kind is Heading.END:
        return leg
    target, onward, exit_speed = leg.target, leg.onward, leg.exit_speed
    if kind is not Heading.PAST:
        along = ((place - leg.origin) * leg.along.conjugate()).real
        target = leg.origin + (along * leg.along if kind is Heading.ONTO else 0)
        onward, following = leg.along, abs(leg.target - target)
        ahead = stopping_speed(limits.jerk, limits.acceleration, following, 0.0)
        exit_speed = min(ahead, leg.speed) if following >= leg.radius else 0.0
    way = target - place
    towards = way / abs(way) if way else 0j
    return replace(leg, target=target, along=towards, onward=onward, exit_speed=exit_speed)
