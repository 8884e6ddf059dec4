"""Flying a path, leg by leg."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot.px4.detour import Heading, excess, headed, heading
from faao_mav.autopilot.px4.guidance import GuidedLeg, legs
from faao_mav.autopilot.px4.parameters import Px4Limits
from faao_mav.autopilot.px4.step import FlightState, at_rest, moved
from faao_mav.errors import InputError

STEP = 0.1
"""The longest step of the simulation, s: the one that was calibrated."""

SWITCH_DELAY = 0.065
"""How long after reaching a waypoint, or after the end of a hold there, the aircraft leaves for the
next, s. Fitted to recorded flights."""

START_LAG = 0.05
"""How long after the first leg becomes current the trajectory moves, s. Fitted to recorded
flights."""

_SETTLED = 2e-3
"""The speed, m/s, below which a holding aircraft is taken to stand. Chosen; what a change costs is
not measured."""

_LEAST_SHARE = 0.01
"""The least share of a step that is flown before it is asked anew what the aircraft heads for."""

_NEAREST = 0.05
"""Radii below this count as this, m: a real aircraft, whose position wavers by more, arrives at
such a waypoint by chance (0.05 m took 53 s), which no prediction foretells."""

_TINY = 1e-9
"""The shortest time, s, and length, m, that count."""


@dataclass(frozen=True, slots=True, eq=False)
class FlownLeg:
    """A leg as it is flown: `arrival` and `departure` at its end, s, and its `end`.

    `time` (k,) s and `motion` (k, 2, n), position m and velocity m/s, are at the end of each step;
    n is 3 with east, north, up or 2 on level paths. Times count from the leg's start.
    """

    arrival: float
    departure: float
    time: Real
    motion: Real
    end: FlightState


@dataclass(frozen=True, slots=True, eq=False)
class FlightLog:
    """A flight: `arrivals`, `departures` (m,) s, and after each step time (k,) s and `motion`.

    `motion` (k, 2, n) is as in `FlownLeg`. Steps are not uniform: they end when a waypoint is left.
    """

    arrivals: Real
    departures: Real
    time: Real
    motion: Real


def simulate(
    limits: Px4Limits,
    points: Real,
    radii: Real,
    speeds: Real,
    holds: Real,
    beyond: float,
    longest: float = inf,
) -> FlightLog:
    """Return the flight along `points` (m, 3), m >= 2, and on for `beyond` s after its end.

    `radii` (m,) m, `speeds` (m - 1,) m/s, `holds` (m,) s. Raises `InputError` for a flight of more
    than `longest` s: only flying tells how long it circles round a small radius.
    """
    radii = np.maximum(radii, _NEAREST)
    route = legs(limits, points, radii.tolist(), speeds.tolist(), holds.tolist())
    east, north, up = points[0].tolist()
    first = at_rest(complex(east, north), up if np.ptp(points[:, 2]) > 0 else None)
    flown, state, left = list[FlownLeg](), first, longest
    for leg in route:
        flown.append(_fly(limits, leg, state, left))
        state = flown[-1].end
        left -= flown[-1].departure
        if left < 0:
            raise InputError(
                f"the waypoints would take more than {longest / 3600:.2g} h and are not followed "
                "that far"
            )
    flown.append(_stay(limits, route[-1], state, beyond))
    start = float(holds[0]) + SWITCH_DELAY if holds[0] > 0 else 0.0
    moving = start + START_LAG
    begun = moving + np.cumsum([0.0] + [each.departure for each in flown[:-1]])
    times = [at + each.time for at, each in zip(begun, flown, strict=True)]
    return FlightLog(
        np.concatenate([[0.0], begun[:-1] + [each.arrival for each in flown[:-1]]]),
        np.concatenate([[start], begun[1:]]),
        np.concatenate([[moving], *times]),
        np.concatenate([_motion([first]), *(each.motion for each in flown)]),
    )


def _fly(limits: Px4Limits, leg: GuidedLeg, state: FlightState, longest: float) -> FlownLeg:
    """Fly along `leg` until its end is left, or until it has taken more than `longest` s."""
    times: list[float] = []
    states: list[FlightState] = []
    time, due, arrival = 0.0, inf, inf
    near = _distances(limits, leg, state)
    kind = heading(leg, state.level[0])
    aim = headed(limits, leg, kind, state.level[0])
    while due - time >= _TINY:
        if time > longest:
            due = time
            break
        before, far = state, near
        dt = due - time
        if due == inf or not _stands(state):
            dt = min(STEP, dt)
            state = moved(limits, aim, before, dt)
        now = heading(leg, state.level[0])
        if now is not kind:
            dt *= _share_before(leg, kind, now, before, state)
            state = moved(limits, aim, before, dt)
        near = _distances(limits, leg, state)
        if due == inf and max(near) <= 0:
            arrival = time + dt * _share(leg, before, dt, far, near)
            due = arrival + SWITCH_DELAY + max(leg.hold, 0.0)
            if due < time + dt:
                dt = due - time
                state = moved(limits, aim, before, dt)
        time += dt
        times.append(time)
        states.append(state)
        if now is not kind or now is Heading.ONTO:
            kind, aim = now, headed(limits, leg, now, state.level[0])
    return FlownLeg(arrival, due, np.array(times), _motion(states), state)


def _share_before(
    leg: GuidedLeg, kind: Heading, then: Heading, before: FlightState, after: FlightState
) -> float:
    """Return the share of a step after which the aircraft heads for `then` instead of `kind`."""
    which = then if kind is Heading.END else kind
    begun, ended = (excess(which, leg, each.level[0]) for each in (before, after))
    share = begun / (begun - ended) if begun != ended else 1.0
    return min(max(share, _LEAST_SHARE), 1.0)


def _stay(limits: Px4Limits, leg: GuidedLeg, state: FlightState, duration: float) -> FlownLeg:
    """Go on for `duration` s after the last waypoint is done."""
    times: list[float] = [0.0]
    states = [state]
    while times[-1] < duration:
        state = moved(limits, leg, state, STEP)
        times.append(times[-1] + STEP)
        states.append(state)
    return FlownLeg(inf, inf, np.array(times), _motion(states), state)


def _stands(state: FlightState) -> bool:
    """Tell whether the aircraft and its trajectory have come to rest."""
    _, velocity, _, _, _, wanted, _ = state.level
    if abs(velocity) + abs(wanted) >= _SETTLED:
        return False
    return state.climb is None or abs(state.climb[1]) + abs(state.climb[5]) < _SETTLED


def _distances(limits: Px4Limits, leg: GuidedLeg, state: FlightState) -> tuple[float, ...]:
    """Return how far the aircraft is from being accepted at the target, m: 0 and less is in."""
    across = abs(state.level[0] - leg.target) - leg.radius
    if state.climb is None:
        return (across,)
    return across, abs(state.climb[0] - leg.height) - max(limits.height_radius, _NEAREST)


def _share(
    leg: GuidedLeg, before: FlightState, dt: float, far: tuple[float, ...], near: tuple[float, ...]
) -> float:
    """Return the share of the step of `dt` s after which the target was accepted."""
    shares = [
        start / max(start - end, _TINY) if start > 0 else 0.0
        for start, end in zip(far, near, strict=True)
    ]
    if far[0] > 0:
        offset = before.level[0] - leg.target
        closing = (offset.conjugate() * before.level[1]).real / max(abs(offset), _TINY)
        shares[0] = _crossing(far[0], closing * dt, near[0])
    return max(shares)


def _crossing(start: float, slope: float, end: float) -> float:
    """Return where in [0, 1] the parabola through `start` > 0 with `slope` to `end` <= 0 is 0."""
    bend = end - start - slope
    root = sqrt(max(slope * slope - 4 * bend * start, 0.0))
    return min(max(2 * start / max(root - slope, _TINY), 0.0), 1.0)


def _motion(states: Sequence[FlightState]) -> Real:
    """Return positions and velocities as in `FlownLeg`."""
    level = np.array([state.level[:2] for state in states])
    axes = [level.real, level.imag]
    if states[0].climb is not None:
        axes.append(np.array([state.climb[:2] for state in states if state.climb is not None]))
    return np.stack(axes, axis=-1)
