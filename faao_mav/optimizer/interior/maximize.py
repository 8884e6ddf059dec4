"""The best flight for a max-min of smooth stage rewards: a structured interior-point method.

    maximise  min_j F_j(w),  F_j(w) = (1 / n) sum_n f_jn(w_n)  under (11), (12), (13d)-(13f)

f may be non-concave: the method finds a local optimum near its start. A least speed is kept by
the half-planes of `slow`, which turn with every step. The limits on ||v_n|| and
||a_n|| are second-order cones with Nesterov-Todd scaling, a predictor and a corrector. t <= F_j
is the barrier -mu c sum_j log(F_j - t), t at its optimum at every point. A start on the limits
is widened by a margin that is driven to zero. A Newton step is one banded LU (`newton`). Where the
curvature of sum_j lambda_j f_j has the wrong sign for a maximum it is cut to zero; where the
rewards are then worse than modelled, a proximal term shortens the step. Repeated short steps
mean that the iterates hug the limits: then the multipliers are centred anew.

Inside, lengths are in 100 m, speeds in v_max, accelerations in a_max, rewards summed over the
slots and divided by the largest gradient at the start.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.rewards import ScaledRewards, Stage, StageValues
from faao_mav.optimizer.interior.search import FAR, NEAR, Opening, Search
from faao_mav.optimizer.kinematics import Kinematics, Trajectory, settled

__all__ = ["FAR", "NEAR", "Optimum", "Stage", "StageValues", "maximize", "maximize_all"]


@dataclass(frozen=True, slots=True)
class Optimum:
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
    tolerance: float = 1e-6,
    max_iterations: int = 100,
    opening: Opening = FAR,
) -> Optimum:
    """Return a local optimum that is never worse than the feasible `start`.

    Where no gain is to be had, as in saturation, or none was found, that is the start itself.
    `stage` is called once for the start, once per trial step and once for the result.
    """
    (found,) = maximize_all(
        kin, stage, [start], tolerance=tolerance, max_iterations=max_iterations, opening=opening
    )
    return found


def maximize_all(
    kin: Kinematics,
    stage: Stage,
    starts: Sequence[Trajectory],
    *,
    tolerance: float = 1e-6,
    max_iterations: int = 100,
    opening: Opening = FAR,
) -> list[Optimum]:
    """Return what `maximize` finds from each of the `starts`; the searches run side by side."""
    w, v = (np.stack(each, axis=1) for each in zip(*((s.w.T, s.v.T) for s in starts), strict=True))
    rewards = ScaledRewards(stage, w)
    first = rewards.first[..., 0]
    search = Search(kin, rewards, w, v, tolerance=tolerance, opening=opening)
    with np.errstate(all="ignore"):  # a step into the unknown is refused, not warned of
        ends = search.run(max_iterations)
    flown = [
        settled(kin, start, ends[k].v.T * kin.max_speed) if k in ends else start
        for k, start in enumerate(starts)
    ]
    means = stage(np.stack([flight.w.T for flight in flown], axis=1)).value.mean(axis=-1)
    found = []
    for k, start in enumerate(starts):
        least = float(first[:, k].min())
        if k not in ends:
            lowest = first[:, k] == least
            found.append(Optimum(start, least, lowest / lowest.sum(), 0, 0.0, True))
            continue
        end, value = ends[k], float(means[:, k].min())
        flight, value = (flown[k], value) if value >= least else (start, least)
        found.append(
            Optimum(flight, value, end.weights, end.iterations, end.residual, end.converged)
        )
    return found
