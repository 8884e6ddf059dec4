"""The rest of a flight, solved again from where the aircraft is, with what its relay holds."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.direct import direct
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.problem import Link, Problem, build_problem
from faao_mav.optimizer.solution import Solution

FEWEST_SLOTS = 4
"""Slots that are left at least where the rest of a flight is solved again; chosen."""

_MISSED = 1e-6
"""By how much a limit may be missed, in its own unit: rounding of 1,000s of slots."""


@dataclass(frozen=True, slots=True, eq=False)
class Rest:
    """A flight of `solution` that is elsewhere than planned when its slot number `slot` begins.

    Before that it was at `flown` (slot, 2), m, when each slot began; then it is at `place` (2,), m,
    with `velocity` (2,), m/s.
    """

    solution: Solution
    slot: int
    flown: Real
    place: Real
    velocity: Real


def solve_rest(rest: Rest) -> Solution:
    """Return the whole flight: as it was flown before `rest.slot`, and the best from there on.

    The plan's clock, its last slot, w_F and the velocity there stay, and so do its limits, the
    fence and the fading of each slot. What is delivered counts, whatever `radio.causal` says. The
    relay begins with what it holds after the slots flown, with the precoders and the shares that
    were planned for them. The search begins at the planned flight and at the plan's own starts.
    Raises `InfeasibleError` where w_F cannot be reached in time.
    """
    solution, slot = rest.solution, rest.slot
    left, plan = len(solution.t) - slot, solution.plan
    if left < FEWEST_SLOTS:
        raise InfeasibleError(f"{max(left, 0)} slots are left of the flight")
    past = _flown(rest)
    east, north = rest.place.tolist()
    flight, radio = replace(plan.flight, start=(east, north)), replace(plan.radio, causal=True)
    whole = build_problem(plan)
    bs_uav, uav_user = (_cut(link, slice(slot, None)) for link in whole.links)
    problem = Problem(
        plan=replace(plan, flight=flight, radio=radio),
        kinematics=replace(
            whole.kinematics,
            start=rest.place,
            start_velocity=rest.velocity,
            end_velocity=solution.v[-1],
            slots=left,
            bound_first_acceleration=True,
        ),
        bs_uav=bs_uav,
        uav_user=uav_user,
        held=past.left * plan.flight.time_step,
    )
    known = Trajectory(solution.w[slot:], solution.v[slot:], solution.a[slot:])
    ahead = direct(problem, known=known)
    missed = problem.kinematics.residuals(ahead.trajectory)
    if problem.fence is not None:
        clearance = problem.fence.clearance(ahead.trajectory, plan.flight.time_step)
        missed["fence"] = problem.fence.margin - clearance
    if max(missed.values()) > _MISSED:
        raise InfeasibleError("the flight that was found breaks the plan's limits")
    values: dict[str, Any] = {
        name: np.concatenate([then, getattr(ahead, name)], axis=-3 if then.ndim > 2 else 0)
        for name, then in past.arrays.items()
    }
    return replace(ahead, plan=plan, t=solution.t, held=solution.held, gain=None, **values)


class _Past(NamedTuple):
    """The arrays of a solution until a slot, and the queue that it leaves, bits."""

    arrays: dict[str, Any]
    left: float


def _flown(rest: Rest) -> _Past:
    """Return what the relay made of the slots that were flown."""
    solution, w, step = rest.solution, rest.flown, float(rest.solution.t[1])
    before = slice(None, rest.slot)
    velocity = np.diff(np.vstack([w, rest.place]), axis=0) / step
    acceleration = np.diff(np.vstack([velocity, rest.velocity]), axis=0) / step
    arrays: dict[str, Any] = {"w": w, "v": velocity, "a": acceleration}
    names = (("P_B", "H_rB", "I_U"), ("P_U", "H_rU", "I_G"))
    for link, (P, H, rates) in zip(build_problem(solution.plan).links, names, strict=True):
        cut = _cut(link, before)
        arrays[P] = getattr(solution, P)[..., before, :, :]
        arrays[H] = cut.small_scale(w)
        arrays[rates] = cut.rates(w, arrays[H], arrays[P])
    if solution.shares is not None:
        arrays["shares"] = solution.shares[before]
    if not rest.slot:
        return _Past(arrays, solution.held / step)
    relayed = solution.relay(arrays["I_U"], arrays["I_G"], arrays.get("shares"))
    last = (part[-1] for part in (relayed.queue, relayed.received, -relayed.forwarded))
    return _Past(arrays, max(float(sum(last)), 0.0))


def _cut(link: Link, slots: slice) -> Link:
    """Return `link` in some of the slots: a known draw of the fading belongs to its slot."""
    if link.nlos is None or link.averaged:
        return link
    return replace(link, nlos=link.nlos[slots])
