"""The best flight for a max-min of smooth stage rewards, from a given start."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.constraint import ALLOWED, A, Constraint, V, every_excess, unknowns
from faao_mav.optimizer.interior.limits import Disc, SpeedChange, TurnRate
from faao_mav.optimizer.interior.rewards import Goal, Stage, StageValues
from faao_mav.optimizer.interior.search import COLD, SLOW, WARM, Search
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory
from faao_mav.radio.relay import RelayQueue

_TOLERANCE = 1e-4
"""Tolerance of the search: a start need not be the nearest flight to the last metre. Chosen."""

_MOST_STEPS = 200
"""Steps after which a search ends. Chosen."""


@dataclass(frozen=True, slots=True)
class LocalOptimum:
    """A feasible flight and its min_j F_j, or what the relay delivers.

    `residual` is the largest of: the scaled gradient of the Lagrangian, the violation of a
    limit, and the complementarity gap per slot; `converged` tells that it met the tolerance.
    """

    trajectory: Trajectory
    value: float
    iterations: int
    residual: float
    converged: bool


def maximize(
    kin: Kinematics,
    stage: Stage,
    start: Trajectory,
    *,
    constraints: Sequence[Constraint] = (),
    tolerance: float = 1e-6,
    max_iterations: int = 100,
    warm: bool = False,
    relay: RelayQueue | None = None,
) -> LocalOptimum:
    """Return a local optimum that is never worse than the feasible `start`.

    `constraints` are kept beside those of `kin`, by `start` too; with `relay`, what it delivers is
    maximised instead. A `warm` start is one that is nearly optimal. Where no gain is to be had, as
    in saturation, or none was found, the optimum is the start itself. `stage` is called once for
    the start, once per trial step and once for the result.

    >>> from faao_mav.optimizer.interior.rewards import StageValues
    >>> kin = Kinematics(np.zeros(2), np.array([100.0, 0.0]), 41, 0.5, 10.0, 3.0, None, None, True)
    >>> def near(w):  # the reward falls with the squared distance from (50, 40), as 1 / km^2
    ...     away = (w - np.array([[50.0], [40.0]]))[:, None]
    ...     packed = np.array([-2e-6, 0, -2e-6])[:, None, None]
    ...     value = -1e-6 * (away * away).sum(axis=0)
    ...     return StageValues(value, -2e-6 * away, np.broadcast_to(packed, (3, *value.shape)))
    >>> start = kin.follow(np.full((41, 2), [5.0, 0.0]))
    >>> best = maximize(kin, near, start)
    >>> best.converged, best.trajectory.w[20].round().tolist()
    (True, [50.0, 40.0])
    """
    goal = Goal(stage, start.w.T, relay, kin.time_step)
    first = objective(goal.base, kin, relay)
    if goal.flat:
        return LocalOptimum(start, first, 0, 0.0, True)
    search = Search(
        kin,
        (*constraints_of(kin), *constraints),
        goal,
        unknowns(kin, start),
        tolerance=tolerance,
        mu=WARM if warm else SLOW if kin.min_speed > 0 else COLD,
    )
    with np.errstate(all="ignore"):  # a step into the unknown is refused, not warned of
        converged = search.run(max_iterations)
    flight = feasible(kin, start, search.v.T * kin.max_speed, constraints)
    value = objective(stage(flight.w.T).value, kin, relay)
    converged &= value > first - tolerance * abs(first)
    if not value >= first:
        flight, value = start, first
    return LocalOptimum(flight, value, search.iterations, search.residual, converged)


def objective(
    values: Real, kin: Kinematics, relay: RelayQueue | None, shares: Real | None = None
) -> float:
    """Return min_j F_j, or what `relay` delivers, of rewards or both rates `values` (J, n)."""
    if relay is None:
        return float(values.mean(axis=1).min())
    I_U, I_G = values
    return relay.relayed(I_U, I_G, kin.time_step, shares).rate


def constraints_of(kin: Kinematics) -> tuple[Constraint, ...]:
    """Return the limits of `kin` itself."""
    east, north = (part / kin.max_speed for part in kin.wind)
    gain = kin.max_acceleration * kin.time_step / kin.max_speed
    limits: list[Constraint] = [Disc(V), Disc(A)]
    if math.isfinite(kin.max_airspeed):
        limits.append(Disc(V, kin.max_airspeed / kin.max_speed, (east, north)))
    if kin.min_speed > 0:
        limits.append(Disc(V, kin.min_speed / kin.max_speed, (east, north), 1.0))
        if math.isfinite(kin.most_fall):
            fall = kin.most_fall * kin.time_step / kin.max_speed
            rise = kin.most_power * kin.time_step / kin.max_speed**2
            limits.append(SpeedChange(gain, fall, rise, (east, north)))
        if kin.turn_binds:
            per_speed = kin.most_turn * kin.max_speed / kin.max_acceleration
            limits.append(TurnRate(gain, per_speed, kin.wind_in_turns**2 / kin.max_speed**2))
    return tuple(limits)


def feasible(
    kin: Kinematics, start: Trajectory, v: Real, constraints: Sequence[Constraint] = ()
) -> Trajectory:
    """Return the flight at the speeds v (n, 2), blended with `start` until it keeps the limits.

    These are `constraints` and those of `kin`. The share of `start` is the least of 0, 1e-9,
    1e-8 ... 0.1 and 1 that will do.
    """
    kept = (*constraints_of(kin), *constraints)
    exact, allowed = kin.follow(v), max(ALLOWED, every_excess(kin, kept, start))
    for share in (0.0, *10.0 ** np.arange(-9, 0)):
        mixed = (
            (1 - share) * own + share * other
            for own, other in ((exact.w, start.w), (exact.v, start.v), (exact.a, start.a))
        )
        blend = Trajectory(*mixed)
        if every_excess(kin, kept, blend) <= allowed:
            return blend
    return start


def nearest_flight(
    kin: Kinematics,
    path: Real,
    start: Trajectory,
    constraints: Sequence[Constraint] = (),
    *,
    first: bool = False,
) -> Trajectory | None:
    """Return the flight nearest to `path` (n, 2) m that keeps the limits of `kin`.

    None where none is found that keeps `constraints` too. `start` is any flight of `kin`. With
    `first` the way there ends with a flight that keeps them.
    """

    def closeness(w: Real) -> StageValues:
        away = (w - path.T)[:, None] / LENGTH
        value = -(away * away).sum(axis=0)
        hessian = np.reshape((-2.0, 0.0, -2.0), (3, 1, 1)) / LENGTH**2
        return StageValues(value, -2 * away / LENGTH, np.broadcast_to(hessian, (3, *value.shape)))

    limits = constraints_of(kin)
    for every in (limits, (*limits, *constraints)) if constraints else (limits,):
        goal = Goal(closeness, start.w.T)
        if goal.flat:
            continue
        search = Search(kin, every, goal, unknowns(kin, start), tolerance=_TOLERANCE, mu=COLD)
        for most in range(1, _MOST_STEPS + 1) if first else (_MOST_STEPS,):
            with np.errstate(all="ignore"):
                converged = search.run(most)
            start = kin.follow(search.v.T * kin.max_speed)
            if converged or (first and every_excess(kin, every, start) <= ALLOWED):
                break
    return start if every_excess(kin, (*limits, *constraints), start) <= ALLOWED else None
