"""An estimated upper bound on what a plan maximises, over all flights and precoders.

It is no proof: the best rates over the gain, on which it rests, are tabulated to about 1e-6 bit,
and precoders without a closed form are those of a local search. Given these rates, each of two
bounds holds for every flight; which are computed is said by the plan. `map_bound` knows the queue,
half duplex and fences, maps of gains and stations that move, and flights by their greatest speed
alone. `axis_bound` knows accelerations along the line through the stations, for aircraft that these
limit; it is for gains by the distance from stations at rest.
"""

from dataclasses import dataclass

import numpy as np

from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.search.axis_bound import axis_bound
from faao_mav.optimizer.search.best_rates import best_rates
from faao_mav.optimizer.search.map_bound import map_bound
from faao_mav.optimizer.solution import Observer, Progress

_TIGHT = 0.03
"""How far above the known plan, as a share of it, a bound may be without another being tried.
Chosen."""


@dataclass(frozen=True, slots=True)
class Bound:
    """The estimate of an upper bound on the rate that a plan maximises: `value`, bit/s/Hz.

    `exact` tells that the best precoders have a closed form; otherwise they are searched.
    """

    value: float
    exact: bool


def upper_bound(problem: Problem, known: float = 0.0, *, observe: Observer | None = None) -> Bound:
    """Estimate an upper bound on what `problem` maximises over all trajectories and precoders.

    That is the delivered rate, or with `radio.causal: false` R_avg. `known` is that rate of any
    plan for it, bit/s/Hz: the better it is, the tighter the bound. `observe` is told the progress.

    >>> from faao_mav import optimize, read_plan
    >>> solution = optimize(read_plan("missions/copter_relay.yaml"))
    >>> 1.0 < upper_bound(solution.problem).value / solution.delivered_rate < 1.1
    True
    """

    def tell(number: int, stage: str, best: float) -> None:
        if observe is not None:
            observe(Progress(number, 2, stage, best))

    tell(0, "the best rates", known)
    rates = best_rates(problem)
    ceiling = min(link.most for link in problem.links)
    relay, kin = problem.maximised_queue, problem.kinematics
    half = relay is not None and relay.half
    value = ceiling
    if value > (1 + _TIGHT) * known:
        fields = [link.gains for link in problem.links]
        corners = np.vstack([kin.start, kin.end, *(field.station for field in fields)])
        extent = float(np.ptp(corners, axis=0).max())
        # there is no way from rest to v_max and back to rest
        accelerating = kin.max_speed**2 / kin.max_acceleration > extent
        radial = all(field.above is None and field.station.ndim == 1 for field in fields)
        if accelerating and not half and radial:
            tell(1, "the bound by the axis", value)
            value = min(value, axis_bound(problem, rates))
        # the axis takes the most of all larger distances: with a gain that rises there, too much
        other = any(not field.square for field in fields)
        if not accelerating or half or problem.free_area is not None or other or not radial:
            tell(1, "the bound over the map", value)
            value = min(value, map_bound(problem, rates))
        value = max(known, value)
    tell(2, "the bound", value)
    exact = all(
        link.closed_form and link.measure == "cutoff" and not link.averaged
        for link in problem.links
    )
    return Bound(value, exact)
