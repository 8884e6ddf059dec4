"""The direct method: one loop over trajectory and precoders on the true rate.

maximise min(R_U, R_G) of (9), (10) under (11)-(13f), or with `radio.causal` what the relay delivers
of both rates: see `rewards.Queue`. More rate in a slot never delivers less, so that the best
precoders are the same. For given positions the best precoders of every slot are a problem of their
own, so that the rates become functions of the trajectory alone; by the envelope theorem their
gradients are those at the best precoders. What is left is a flight through two fields of rates,
which `interior` solves in time linear in the number of slots.

Measured (benchmarks/direct_against_ipopt.py): never below CasADi + IPOPT from the same
starts, and several times quicker.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.design import Design, Link, design
from faao_mav.optimizer.interior.constraint import ALLOWED, every_excess
from faao_mav.optimizer.interior.maximize import LocalOptimum, feasible, nearest_flight, objective
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.problem import Problem, build_problem, counted_as_cutoff
from faao_mav.optimizer.rates import RateModel, link_coordinates
from faao_mav.optimizer.rates.field import RateField, rate_field
from faao_mav.optimizer.search.over_map import improved_over_map, starts_over_map
from faao_mav.optimizer.search.starts import (
    BY_STATIONS,
    ROUGH,
    improve_starts,
    paced,
    sparing_starts,
    starts,
)
from faao_mav.optimizer.shadowing import SHADES, shaded, under_shadowing
from faao_mav.optimizer.solution import Observer, Progress, Solution, make_solution
from faao_mav.plan import Plan
from faao_mav.radio.gain import GainField
from faao_mav.radio.rate_steps import RateSteps

_LONG_SEARCH = 6
"""By how many times `optimizer.max_iterations` may be exceeded. Chosen: half-duplex plans with a
buffer need up to 300 steps."""

_WIDTHS = (1.5, 0.5)
"""Decibels over which steps of a radio's own rates rise in the last searches. Chosen: of a step
that is flown at, half of the last keeps the aircraft on it, 3 % of the distance."""

_EQUAL = 1e-6
"""The difference of values, bit/s/Hz, below which flights are equally good: which of two is larger
is then up to rounding, and differs from machine to machine. Chosen."""

_FOLLOWED = 2
"""Starts over a map that are improved: the best as they are. Chosen."""

_ROUGHLY, _ROUGH_STEPS = 1e-2, 12
"""Tolerance, bit/s/Hz, and steps of the search of a rough flight, twice as many with a least speed.

Measured with the user dragged by 70 to 100 m: `copter_relay.yaml` 0.14 % below the finished flight,
`plane_relay.yaml` 0 to 3 % from a finished flight nearby, 22 to 25 % from none.
"""


def direct(
    problem: Problem,
    *,
    observe: Observer | None = None,
    known: Trajectory | None = None,
    alone: bool = False,
    rough: bool = False,
) -> Solution:
    """Optimise trajectory and precoders of `problem` together.

    The starts of `optimizer.starts` are improved roughly where there are several, and the best of
    them to the end; the flight `known` of a similar plan is one more, or `alone` the only one.
    The result is never worse than any start. A `rough` flight is one short search from one start.
    Raises `InfeasibleError` when there is no flight at all.
    """
    scheme, own_steps = design(problem.plan, problem.precoder), problem.uav_user.steps
    counts_cutoff = problem.plan.optimizer.rate == "cutoff" or scheme.gaussian
    before = None if counts_cutoff or rough else direct(counted_as_cutoff(problem))

    def tell(number: int, stage: str, best: float) -> None:
        if observe is not None:
            observe(Progress(number, 2, stage, best))

    tell(0, "rates over the map", 0.0)
    search = _Search(problem, scheme, rate_field(problem, scheme), rough)
    routes = search.routes(before, known, alone=alone)
    tell(1, "the starts", 0.0)
    begun = {name: search.value(flight) for name, flight in routes.items()}
    flights, reached, several = dict(routes), dict(begun), len(routes) > 1
    if several and not problem.mapped:
        improved = improve_starts(problem, search.field, routes, search.most_steps)
        for name, flight in improved.items():
            if (value := search.value(flight)) > begun[name]:
                flights[name], reached[name] = flight, value
    if problem.mapped:
        going = sorted(reached, key=reached.__getitem__, reverse=True)[:_FOLLOWED]
    else:
        equal = (search.best(reached, flights, within) for within in (_EQUAL, ROUGH))
        going = list(dict.fromkeys(equal))
    tell(2, "the best start", reached[going[0]])
    warm = several or (rough and alone and problem.kinematics.min_speed == 0)
    optima = {name: search.followed(flights[name], warm=warm) for name in going}
    ends = {name: each.trajectory for name, each in optima.items()}
    best = optima[search.best({name: each.value for name, each in optima.items()}, ends)]
    if not rough:
        if isinstance(own_steps, RateSteps):
            best = search.sharpened([*optima.values(), replace(best, trajectory=flights[going[0]])])
        if any(problem.plan.radio.spreads):
            best = search.under_shadowing(best)
    flight = best.trajectory
    precoders = [
        search.precoders(link, rate, flight.w)
        for link, rate in zip(search.field.links, search.field.rates, strict=True)
    ]
    ending = f"stationary to {best.residual:.1e}"
    if not best.converged:
        ending = f"stopped after {best.iterations} steps, {ending}"
    solution = make_solution(
        problem,
        flight,
        precoders,
        [],
        converged=best.converged,
        ending=ending,
        # the sums of the mutual information take longer than all else of a rough flight
        rates=search.field.value(flight.w.T) if rough and not counts_cutoff else None,
    )
    found = solution.maximised
    # values by tables may be above those of the precoders, and without shadowing more is delivered
    history = np.maximum.accumulate([next(iter(begun.values())), *reached.values()])
    reached |= {name: search.value(flight) for name, flight in ends.items()}
    return replace(
        solution,
        history=np.append(np.minimum(history, found), found),
        starts={name: min(each, found) for name, each in reached.items()},
        gain=None
        if before is None
        else found - problem.value(problem.rates(before.w, [before.P_B, before.P_U])),
    )


def rough_flight(plan: Plan, near: Real | None = None) -> Solution:
    """Return a good flight of `plan` in a fraction of the time that `optimize` takes.

    It is what a person sees while a station is dragged. The search starts from the velocities
    `near` (n, 2), m/s, those of the flight of a similar plan, as far as they keep this plan's
    limits. Raises `InfeasibleError` where there is no flight.

    >>> from faao_mav import read_plan
    >>> flight = rough_flight(read_plan("missions/copter_relay.yaml"))
    >>> flight.w.shape, 2.1 < flight.delivered_rate < 2.25
    ((240, 2), True)
    """
    problem = build_problem(plan)
    kin, known = problem.kinematics, None
    if near is not None and near.shape == (kin.slots, 2):
        known = kin.follow(near)
        # over a map a path of its own is better than one that is blended with the straight one
        if problem.mapped and every_excess(kin, problem.limits(kin), known) > ALLOWED:
            known = None
    return direct(problem, known=known, alone=known is not None, rough=True)


@dataclass(frozen=True, slots=True)
class _Search:
    """The search for the best flight of `problem`, by the rates over `field` of a `scheme`."""

    problem: Problem
    scheme: Design
    field: RateField
    rough: bool = False

    @property
    def most_steps(self) -> int:
        """Steps of one search at most."""
        if self.rough:
            return _ROUGH_STEPS * (2 if self.problem.kinematics.min_speed > 0 else 1)
        return self.problem.plan.optimizer.max_iterations * _LONG_SEARCH

    def value(self, flight: Trajectory) -> float:
        """Return what is reported: by the alphabet or the steps; if rough, by the tables."""
        problem = self.problem
        if self.rough or (not self.scheme.gaussian and problem.uav_user.steps is None):
            return problem.value(self.field.value(flight.w.T))
        precoders = [self.scheme.precoders(link, link.channel(flight.w)) for link in problem.links]
        return problem.value(problem.rates(flight.w, precoders))

    def routes(
        self, before: Solution | None, known: Trajectory | None, *, alone: bool
    ) -> dict[str, Trajectory]:
        """Return the flights from which the search starts, by name.

        They are those of `optimizer.starts`, over maps those of `map`; `cutoff`, that of the plan
        for the cutoff rate `before`; and `known`, that of a similar plan, or this `alone`.
        """
        problem, kin = self.problem, self.problem.kinematics
        fenced, routes = problem.fenced(kin), dict[str, Trajectory]()
        stations = {"bs": problem.bs_uav.gains.midway, "user": problem.uav_user.gains.midway}
        one = alone or self.rough or problem.mapped
        names: Sequence[str] = ("straight",) if one else problem.plan.optimizer.starts
        if "global" in names:
            few = kin.min_speed == 0 and problem.plan.radio.causal
            names = [name for name in BY_STATIONS if not few or name not in stations]
        again = None if known is None else self._in_time(known)
        if alone and again is not None:
            near = kin.follow(again)
            if every_excess(kin, problem.limits(kin), near) <= ALLOWED:
                return {"known": near}
        if problem.mapped and not alone:
            routes = starts_over_map(problem, self.field, rough=self.rough)
        if not routes:
            routes = starts(kin, names, stations, problem.free_area, fenced)
        if self.rough:
            routes = dict(islice(routes.items(), 1))
        if before is not None:
            routes["cutoff"] = before.trajectory
        if again is not None:
            near = feasible(kin, next(iter(routes.values())), again, fenced)
            routes = {"known": near} if alone else routes | {"known": near}
        if problem.energy < np.inf:
            routes = sparing_starts(kin, routes, problem.limits(kin))
            if not routes:
                raise InfeasibleError("no flight was found that takes so little energy")
        return routes

    def _in_time(self, flight: Trajectory) -> Real:
        """Return velocities (n, 2) at which the path of `flight` takes the time of the problem.

        With a least speed they are those of the nearest flight that has it, if one is found.
        """
        kin = self.problem.kinematics
        slower, limits = paced(kin, flight, kin.time_step), self.problem.limits(kin)
        if kin.min_speed == 0 or every_excess(kin, limits, kin.follow(slower)) <= ALLOWED:
            return slower
        then, now = (np.linspace(0, 1, n) for n in (kin.slots, len(flight.w)))
        path = np.stack([np.interp(then, now, w) for w in flight.w.T], axis=1)
        near = nearest_flight(kin, path, kin.follow(slower), self.problem.constraints(kin))
        return slower if near is None else near.v

    def followed(self, start: Trajectory, *, warm: bool = True) -> LocalOptimum:
        """Return what is found from `start`: over maps close by, by the maps as they are."""
        problem, field, steps = self.problem, self.field, self.most_steps
        if problem.mapped:
            return improved_over_map(problem, field, start, steps, rough=self.rough)
        tolerance = _ROUGHLY if self.rough else problem.plan.optimizer.tolerance
        return problem.improved(field, start, tolerance, steps, warm=warm)

    def best(
        self, values: Mapping[str, float], flights: Mapping[str, Trajectory], within: float = _EQUAL
    ) -> str:
        """Return which of the `flights` with values `within` the best one's delivers most.

        A route and its mirror image have the same R_avg, and may deliver very different amounts.
        """
        most = max(values.values()) - within

        def delivered(name: str) -> float:
            rates = self.field.value(flights[name].w.T)
            return round(objective(rates, self.problem.kinematics, self.problem.relay) / _EQUAL)

        return max((name for name in values if values[name] > most), key=delivered)

    def sharpened(self, optima: list[LocalOptimum]) -> LocalOptimum:
        """Return the best by the steps themselves of `optima` and of those for sharper steps."""
        found, now = [*optima], optima
        for width in _WIDTHS:
            sharper = replace(self, field=rate_field(self.problem, self.scheme, width))
            now = [sharper.followed(each.trajectory) for each in now]
            found += now
        return max(found, key=lambda each: self.value(each.trajectory))

    def under_shadowing(self, optimum: LocalOptimum) -> LocalOptimum:
        """Return the best under shadowing of `optimum` and of those less about one place."""
        begin, problem, field = optimum.trajectory, self.problem, self.field
        options, found = problem.plan.optimizer, [optimum]
        for z in SHADES:
            stage = shaded(problem, field.over(GainField.smoothed), begin.w, z)
            limits = options.tolerance, options.max_iterations
            found.append(problem.improved(stage, begin, *limits, warm=True))

        def value(w: Real) -> float:
            return under_shadowing(problem, w, partial(field.value, w.T)).worth

        return max(found, key=lambda each: value(each.trajectory.w))

    def precoders(self, link: Link, rate: RateModel, w: Real) -> Complex:
        """Return the precoders at positions w (n, 2), searched from the best that `rate` knows.

        With known draws they are searched afresh too, and the better kept. Rough ones are not
        searched.
        """
        H, scheme = link.channel(w), self.scheme
        near = rate.initial_precoders(*link_coordinates(link, w.T)) if scheme.optimal else None
        if near is None:
            return scheme.precoders(link, H)
        if link.measure != "cutoff" or self.rough:
            return near
        carried = scheme.precoders(link, H, start=near)
        if scheme.averaged or link.nlos is None:
            return carried
        afresh = scheme.precoders(link, H)
        better = scheme.rate(link, H, carried) > scheme.rate(link, H, afresh)
        return np.asarray(np.where(better[:, None, None], carried, afresh))
