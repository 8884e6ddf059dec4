"""A rough flight at once: what a person sees while a station is dragged.

One start, one short search, and the rates of the tables alone: no bound, no precoders of their own
for each slot.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.design import design
from faao_mav.optimizer.interior.constraint import ALLOWED, every_excess
from faao_mav.optimizer.interior.maximize import feasible
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.search.over_map import ROUGHLY, flights_over_map, improved_over_map
from faao_mav.optimizer.search.starts import starts
from faao_mav.plan import Plan
from faao_mav.radio.relay import Relayed

_TOLERANCE, _ITERATIONS = 1e-2, 25
"""Tolerance, bit/s/Hz, and steps of the search; half as many without a least speed.

Measured with the user dragged by 70 to 100 m: `copter_relay.yaml` 0.14 % below the finished flight,
`plane_relay.yaml` 0 to 3 % from a finished flight nearby, 22 to 25 % from none.
"""

_CELLS = 800
"""Cells of the path over a map. Chosen: it takes a tenth of a second."""


@dataclass(frozen=True)
class RoughFlight:
    """A feasible flight of `plan`, rates of its slots, what is relayed: fields of a `Solution`.

    >>> from faao_mav import read_plan
    >>> flight = rough_flight(read_plan("missions/copter_relay.yaml"))
    >>> flight.w.shape, 2.1 < flight.delivered_rate < 2.25
    ((240, 2), True)
    """

    plan: Plan
    t: Real
    w: Real
    v: Real
    I_U: Real
    I_G: Real
    relayed: Relayed

    @property
    def delivered_rate(self) -> float:
        """The delivered rate R_del, bit/s/Hz."""
        return self.relayed.rate


def rough_flight(plan: Plan, near: Real | None = None) -> RoughFlight:
    """Return a good flight of `plan` in a fraction of the time that `optimize` takes.

    The search starts from the velocities `near` (n, 2), m/s, those of the flight of a similar plan,
    as far as they keep this plan's limits. Raises `InfeasibleError` where there is no flight.
    """
    problem = build_problem(plan)
    kin, field = problem.kinematics, rate_field(problem, design(plan))
    kept, slow = problem.constraints(kin), kin.min_speed > 0
    near = None if near is None or near.shape != (kin.slots, 2) else near
    again = None if near is None else kin.follow(near)
    if problem.mapped and (
        again is None or every_excess(kin, problem.limits(kin), again) > ALLOWED
    ):
        again = next(flights_over_map(problem, field, _CELLS), None)
    if not problem.mapped or again is None:
        start = next(iter(starts(kin, ("straight",), {}, problem.free_area, kept).values()))
        again = start if near is None or problem.mapped else feasible(kin, start, near, kept)
    steps = _ITERATIONS if slow else _ITERATIONS // 2
    if problem.mapped:
        best = improved_over_map(problem, field, again, steps, ROUGHLY, most=1).trajectory
    else:
        warm = again is not start and not slow
        best = problem.improved(field, again, _TOLERANCE, steps, warm=warm).trajectory
    I_U, I_G = field.value(best.w.T)
    t = np.asarray(kin.time_step * np.arange(kin.slots))
    relayed = problem.relay.relayed(I_U, I_G, kin.time_step)
    return RoughFlight(plan, t, best.w, best.v, I_U, I_G, relayed)
