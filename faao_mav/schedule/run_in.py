"""Legs before w_I and after w_F for plans that begin or end at speed."""

from dataclasses import replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.schedule.route import Route
from faao_mav.vector import lengths
from faao_mav.vehicle.legs import Legs

_MOVING = 0.5
"""Slower ends than this, m/s, are taken as hovers."""


def with_run_in(route: Route, t: Real, w: Real, legs: Legs, max_speed: float) -> Route:
    """Return `route` with a leg that is long enough to be at the plan's first speed at w_I.

    Likewise one after w_F, so that the aircraft does not brake before it. Ends at which the plan
    waits, or is hardly moving, get none. `t` (n,) s, `w` (n, 2) m.
    """
    if len(route.positions) < 2:
        return route
    into, out = _end_velocities(t, w)
    if begins_at_speed(t, w) and route.departures[0] == route.arrivals[0]:
        lead, lasting = _lead(into, legs, max_speed)
        route = replace(
            _with(route, 0, route.positions[0] - lead, route.arrivals[0] - lasting, into),
            first=1,
            last=route.last + 1,
        )
        route.holds[1] = 0.0
    if _speed(out) > _MOVING and route.departures[-1] == route.arrivals[-1]:
        lead, lasting = _lead(out, legs, max_speed)
        end = len(route.positions)
        route = _with(route, end, route.positions[-1] + lead, route.departures[-1] + lasting, out)
    return route


def begins_at_speed(t: Real, w: Real) -> bool:
    """Tell whether the plan `t` (n,) s, `w` (n, 2) m does not begin with a hover."""
    return _speed(_end_velocities(t, w)[0]) > _MOVING


def _end_velocities(t: Real, w: Real) -> tuple[Real, Real]:
    """Return the velocities (2,), m/s, at which the plan begins and ends.

    Of second order: the mean over the first slot is not 0 for a plan that speeds up from rest.
    """
    if len(t) < 3:
        between = (w[-1] - w[0]) / (t[-1] - t[0])
        return between, between
    first = np.gradient(w[:3], t[:3], axis=0, edge_order=2)[0]
    last = np.gradient(w[-3:], t[-3:], axis=0, edge_order=2)[-1]
    return first, last


def _speed(velocity: Real) -> float:
    return float(lengths(velocity))


def _lead(velocity: Real, legs: Legs, max_speed: float) -> tuple[Real, float]:
    """Return the way, (2,) m, on which `velocity` can be reached, and its nominal duration, s."""
    speed = min(_speed(velocity), max_speed)
    length = legs.run_in * float(legs.shortest_leg(np.array([speed]))[0])
    return velocity / _speed(velocity) * length, length / speed


def _with(route: Route, at: int, position: Real, time: float, velocity: Real) -> Route:
    """Return `route` with a waypoint more at its beginning (`at` 0) or its end."""
    speed = np.array([_speed(velocity)])
    return route.with_waypoints(np.array([at]), position[None], np.array([time]), speed)
