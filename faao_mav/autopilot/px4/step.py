"""One step of a flight along a leg."""

from math import erf, exp, hypot, pi, sqrt
from typing import NamedTuple

from faao_mav.autopilot.px4.guidance import GuidedLeg, climb_setpoint, level_setpoint
from faao_mav.autopilot.px4.parameters import Px4Limits
from faao_mav.autopilot.px4.response import Motion, Number, advance, step_of
from faao_mav.autopilot.px4.smoothing import Axis, follow, soon_there

_ESTIMATE_ALONG, _ESTIMATE_ACROSS = 0.8, 0.1
"""How far the position estimate strays from the trajectory along the way and across it, m rms, were
the trajectory not to wait. Fitted to recorded flights."""

_ESTIMATE_RATE = 0.05
"""The rate, 1/s, at which the estimate's error along the way is forgotten. Fitted to recorded
flights."""

_TINY = 1e-9
"""The speed, m/s, below which nothing moves."""


class FlightState(NamedTuple):
    """How an aircraft moves, horizontally (east + i north) and, where the path climbs, upwards.

    `remembered` is what speed was allowed before a turn, m/s.
    """

    level: Motion[complex]
    climb: Motion[float] | None
    remembered: float


def at_rest(place: complex, height: float | None) -> FlightState:
    """Return the state of an aircraft that hovers; `height` is None for level paths."""
    climb = None if height is None else (height, 0.0, 0.0, 0.0, height, 0.0, 0.0)
    return FlightState((place, 0j, 0j, 0j, place, 0j, 0j), climb, 0.0)


def moved(limits: Px4Limits, leg: GuidedLeg, state: FlightState, dt: float) -> FlightState:
    """Return `state` after `dt` s on the way along `leg`.

    What is asked for halfway along the step is pursued all along it.
    """
    level, climb, remembered = state
    position, _, _, _, place, velocity, acceleration = level
    midway = place + velocity * (dt / 2)
    direction, speed, remembered = level_setpoint(limits, leg, midway, velocity, remembered)
    clock = dt * _pace(limits.error_limit, place - position, velocity)
    body = limits.body  # drag to 1e-3, so that few steps are worked out
    drag = round(body.linear_drag + body.quadratic_drag * abs(level[1]), 3)
    step = step_of(dt, body.lag, drag)
    if climb is None:
        after, push, _ = _pursued(limits, level, direction * speed, None, clock)
    else:
        _, _, _, _, height, rate, lift = climb
        distance, halfway = abs(leg.target - midway), height + rate * (dt / 2)
        speed, ascent = climb_setpoint(limits, leg, distance, halfway, speed)
        most = limits.climb_acceleration if ascent > 0 else limits.descent_acceleration
        upwards = (rate, lift, ascent, most)
        after, push, up = _pursued(limits, level, direction * speed, upwards, clock)
        climb = advance(step, climb, _shift(rate, lift, *up, clock), *up)
    shift = _shift(velocity, acceleration, after, push, clock)
    return FlightState(advance(step, level, shift, after, push), climb, remembered)


def _pace(limit: float, lag: complex, velocity: complex) -> float:
    """Return the mean rate of the trajectory's clock: 1 less the lag's share of the `limit`.

    An aircraft ahead of its trajectory does not hold it up. How far it is behind wavers with the
    position estimate: by s along the way, normally distributed, where s² = s_0² r / (r + v / limit)
    with the rate r of forgetting, for waiting takes away what the estimate strays.
    """
    speed = abs(velocity)
    if speed < _TINY:
        return 1.0
    lag = lag * velocity.conjugate() / speed
    wander = _ESTIMATE_ALONG * sqrt(_ESTIMATE_RATE / (_ESTIMATE_RATE + speed / limit))
    score = lag.real / wander
    share = (1 + erf(score / sqrt(2))) / 2
    along = lag.real * share + wander * exp(-score * score / 2) / sqrt(2 * pi)
    behind = hypot(along, share * hypot(lag.imag, _ESTIMATE_ACROSS))
    return 1 - min(behind / limit, 1.0)


def _pursued(
    limits: Px4Limits, level: Motion[complex], setpoint: complex, upwards: Axis | None, dt: float
) -> tuple[complex, complex, tuple[float, float]]:
    """Return horizontal velocity and acceleration after `dt` s, and the two upwards, if any."""
    _, _, _, _, _, velocity, acceleration = level
    error, push = abs(setpoint - velocity), abs(acceleration)
    ascent = 0.0
    if upwards is not None:
        rate, lift, ascent, _ = upwards
        error, push = max(error, abs(ascent - rate)), max(push, abs(lift))
    if soon_there(error, push, limits.jerk, dt):
        return setpoint if error > _TINY else velocity, 0j, (ascent, 0.0)
    most = limits.acceleration
    axes = [
        (velocity.real, acceleration.real, setpoint.real, most),
        (velocity.imag, acceleration.imag, setpoint.imag, most),
    ]
    if upwards is not None:
        axes.append(upwards)
    (east, east_push), (north, north_push), *up = follow(axes, limits.jerk, dt)
    return complex(east, north), complex(east_push, north_push), up[0] if up else (0.0, 0.0)


def _shift(
    velocity: Number, acceleration: Number, after: Number, acceleration_after: Number, dt: float
) -> Number:
    """Return the displacement during a ramp of `dt` s, m."""
    return dt / 2 * (velocity + after) - dt * dt / 12 * (acceleration_after - acceleration)
