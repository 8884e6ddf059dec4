"""The best flight for a max-min of smooth stage rewards, from given starts."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.constraint import Constraint
from faao_mav.optimizer.interior.limits import AirspeedLimit, FlightLimits
from faao_mav.optimizer.interior.min_speed import limits_with_least_speed
from faao_mav.optimizer.interior.queue import Queue, QueueRewards
from faao_mav.optimizer.interior.rewards import ScaledRewards, Stage
from faao_mav.optimizer.interior.search import (
    COLD_START,
    SLOW_START,
    Search,
    StartStrategy,
)
from faao_mav.optimizer.interior.speed_change import speed_change
from faao_mav.optimizer.interior.turn_rate import turn_rate
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.radio.relay import RelayQueue

_ALLOWED = 1e-9
"""The violation of a limit, relative to it, that a flight may have: rounding of 1,000s of slots."""


@dataclass(frozen=True, slots=True)
class LocalOptimum:
    """A feasible flight, its min_j F_j, and the multipliers of t <= F_j, which sum to one.

    `residual` is the largest of: the scaled gradient of the Lagrangian, the violation of a
    limit, and the complementarity gap per slot; `converged` tells that it met the tolerance.
    """

    trajectory: Trajectory
    value: float
    weights: Real
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
    strategy: StartStrategy | None = None,
    relay: RelayQueue | None = None,
) -> LocalOptimum:
    """Return a local optimum that is never worse than the feasible `start`.

    `constraints` are kept beside those of `kin`, by `start` too; with `relay`, what it delivers is
    maximised instead. Without a `strategy` it is that for any start. Where no gain is to be had, as
    in saturation, or none was found, the optimum is the start itself. `stage` is called once for
    the start, once per trial step and once for the result.

    >>> from faao_mav.optimizer.interior.rewards import StageValues
    >>> kin = Kinematics(np.zeros(2), np.array([100.0, 0.0]), 41, 0.5, 10.0, 3.0, None, None, True)
    >>> def near(w):  # the reward falls with the squared distance from (50, 40), as 1 / km^2
    ...     away = (w - np.array([50.0, 40.0]).reshape(2, *[1] * (w.ndim - 1)))[:, None]
    ...     packed = np.array([-2e-6, 0, -2e-6]).reshape(3, *[1] * w.ndim)
    ...     value = -1e-6 * (away * away).sum(axis=0)
    ...     return StageValues(value, -2e-6 * away, np.broadcast_to(packed, (3, *value.shape)))
    >>> start = kin.follow(np.full((41, 2), [5.0, 0.0]))
    >>> best = maximize(kin, near, start)
    >>> best.converged, best.trajectory.w[20].round().tolist()
    (True, [50.0, 40.0])
    """
    (optimum,) = maximize_all(
        kin,
        stage,
        [start],
        constraints=constraints,
        tolerance=tolerance,
        max_iterations=max_iterations,
        strategy=strategy,
        relay=relay,
    )
    return optimum


def maximize_all(
    kin: Kinematics,
    stage: Stage,
    starts: Sequence[Trajectory],
    *,
    constraints: Sequence[Constraint] = (),
    tolerance: float = 1e-6,
    max_iterations: int = 100,
    strategy: StartStrategy | None = None,
    relay: RelayQueue | None = None,
) -> list[LocalOptimum]:
    """Return what `maximize` finds from each of the `starts`; the searches run side by side."""
    kept: Sequence[Constraint] = (*constraints_of(kin), *constraints)
    strategy = strategy or (SLOW_START if kin.min_speed > 0 else COLD_START)
    w, v = (np.stack(each, axis=1) for each in zip(*((s.w.T, s.v.T) for s in starts), strict=True))
    if relay is None:
        rewards = ScaledRewards(stage, w)
    else:
        rewards = QueueRewards(stage, w)
        kept = (*kept, Queue(rewards, relay.half, relay.buffer / kin.time_step))
    first = objectives(rewards.base, kin, relay)
    search = Search(kin, kept, rewards, w, v, tolerance=tolerance, strategy=strategy)
    with np.errstate(all="ignore"):  # a step into the unknown is refused, not warned of
        results = search.run(max_iterations)
    flights = [
        feasible(kin, start, results[k].v.T * kin.max_speed, kept) if k in results else start
        for k, start in enumerate(starts)
    ]
    reached = objectives(stage(np.stack([f.w.T for f in flights], axis=1)).value, kin, relay)
    optima = []
    for k, start in enumerate(starts):
        least, value = float(first[k]), float(reached[k])
        if k not in results:
            means = rewards.first[:, k, 0]
            lowest = means == means.min()
            optima.append(LocalOptimum(start, least, lowest / lowest.sum(), 0, 0.0, True))
            continue
        end = results[k]
        # inside a search that keeps its limits a start is as good an end as any, else only where
        # what was found is as good to the tolerance
        equal = value > least - tolerance * abs(least) or isinstance(kept[0], FlightLimits)
        converged = end.converged and equal
        flight, value = (flights[k], value) if value >= least else (start, least)
        optima.append(
            LocalOptimum(flight, value, end.weights, end.iterations, end.residual, converged)
        )
    return optima


def objectives(values: Real, kin: Kinematics, relay: RelayQueue | None) -> Real:
    """Return min_j F_j, or what `relay` delivers of both rates `values` (J, flights, n)."""
    if relay is None:
        return np.asarray(values.mean(axis=-1).min(axis=0))
    flights = values.swapaxes(0, 1)
    return np.array([relay.relayed(I_U, I_G, kin.time_step).rate for I_U, I_G in flights])


def constraints_of(kin: Kinematics) -> tuple[Constraint, ...]:
    """Return the constraints of `kin` itself, the limits on speed and acceleration first."""
    if kin.min_speed > 0:
        changes = () if math.isinf(kin.most_fall) else (speed_change(kin),)
        turns = (turn_rate(kin),) if kin.turn_binds else ()
        return (*limits_with_least_speed(kin), *changes, *turns)
    if math.isinf(kin.max_airspeed):
        return (FlightLimits(),)
    east, north = (part / kin.max_speed for part in kin.wind)
    return FlightLimits(), AirspeedLimit(kin.max_airspeed / kin.max_speed, (east, north))


def feasible(
    kin: Kinematics,
    start: Trajectory,
    v: Real,
    constraints: Sequence[Constraint] | None = None,
) -> Trajectory:
    """Return the flight at the speeds v (n, 2), blended with `start` until it keeps the limits.

    The share of `start` is the least of 0, 1e-9, 1e-8 ... 0.1 and 1 that will do.
    """
    kept = constraints_of(kin) if constraints is None else constraints

    def excess(flight: Trajectory) -> float:
        return max(constraint.excess(kin, flight) for constraint in kept)

    exact, allowed = kin.follow(v), max(_ALLOWED, excess(start))
    for share in (0.0, *10.0 ** np.arange(-9, 0)):
        blend = Trajectory(
            *(
                (1 - share) * own + share * other
                for own, other in (
                    (exact.w, start.w),
                    (exact.v, start.v),
                    (exact.a, start.a),
                )
            )
        )
        if excess(blend) <= allowed:
            return blend
    return start
