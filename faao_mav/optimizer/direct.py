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

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.design import Design, design
from faao_mav.optimizer.interior.maximize import (
    LocalOptimum,
    constraints_of,
    feasible,
    maximize,
    objective,
)
from faao_mav.optimizer.interior.rewards import Stage
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.problem import Link, Problem, counted_as_cutoff
from faao_mav.optimizer.rates import RateModel, link_coordinates
from faao_mav.optimizer.rates.field import RateField, rate_field
from faao_mav.optimizer.search.multistart import EQUAL, improve_starts, paced
from faao_mav.optimizer.search.over_map import improved_over_map, starts_over_map
from faao_mav.optimizer.search.starts import sparing_starts, starts
from faao_mav.optimizer.search.track import nearest_flight
from faao_mav.optimizer.shadowing import TOLLS, spread_known, tolled, worth
from faao_mav.optimizer.solution import Observer, Progress, Solution, make_solution
from faao_mav.radio.rate_steps import RateSteps

_LONG_SEARCH = 6
"""By how many times `optimizer.max_iterations` may be exceeded. Chosen: half-duplex plans with a
buffer need up to 300 steps."""

_WIDTHS = (1.5, 0.5)
"""Decibels over which steps of a radio's own rates rise in the last searches. Chosen: of a step
that is flown at, half of the last keeps the aircraft on it, 3 % of the distance."""

_FOLLOWED = 2
"""Starts over a map that are improved: the best as they are. Chosen."""

_TOLLED_ITERATIONS = 40
"""Iterations of a flight under shadowing, at most. Chosen."""


def direct(
    problem: Problem,
    *,
    observe: Observer | None = None,
    known: Trajectory | None = None,
    alone: bool = False,
) -> Solution:
    """Optimise trajectory and precoders of `problem` together.

    The starts of `optimizer.starts` are improved roughly where there are several, and the best of
    them to the end; the flight `known` of a similar plan is one more, or `alone` the only one.
    The result is never worse than any start. Raises `InfeasibleError` when there is no flight at
    all.
    """
    kin, relay = problem.kinematics, problem.maximised_queue
    scheme, own_steps = design(problem.plan, problem.precoder), problem.uav_user.steps
    counts_cutoff = problem.plan.optimizer.rate == "cutoff" or scheme.gaussian
    before = None if counts_cutoff else direct(counted_as_cutoff(problem))

    def tell(number: int, stage: str, best: float) -> None:
        if observe is not None:
            observe(Progress(number, 2, stage, best))

    tell(0, "rates over the map", 0.0)
    field = rate_field(problem, scheme)

    def value(flight: Trajectory) -> float:
        """What is reported: rates of the alphabet, or the steps, not what smooths them."""
        if scheme.gaussian or own_steps is not None:
            return _worth(problem, flight.w, _designed(problem, scheme, flight.w))
        return objective(field.value(flight.w.T), kin, relay)

    routes = _routes(problem, before, known, field, alone=alone)
    tell(1, "the starts", 0.0)
    steps = problem.plan.optimizer.max_iterations * _LONG_SEARCH
    begun = {name: value(flight) for name, flight in routes.items()}
    improved, reached, going = routes, begun, list(routes)
    if problem.mapped:
        going = sorted(begun, key=begun.__getitem__, reverse=True)[:_FOLLOWED]
    elif len(routes) > 1:  # a single start needs no comparison
        improved, going = improve_starts(problem, field, routes, steps)
        reached = {name: value(flight) for name, flight in improved.items()}
    first, then = (max(each, key=each.__getitem__) for each in (begun, reached))
    starts, best_yet = [improved[name] for name in going], improved[then]
    if begun[first] > reached[then]:  # no start was improved as far
        best_yet = routes[first]
        starts.append(best_yet)
    tell(2, "the best start", max(begun[first], reached[then]))
    warm = len(routes) > 1
    optima = [_followed(problem, field, start, steps, warm=warm) for start in starts]
    ends = {name: value(end.trajectory) for name, end in zip(going, optima, strict=False)}
    best = _best(problem, field, optima)
    if isinstance(own_steps, RateSteps):
        best = _sharpened(problem, scheme, [*optima, replace(best, trajectory=best_yet)], steps)
    if spread_known(problem):
        best = _under_shadowing(problem, field, best)
    flight = best.trajectory
    precoders = [
        _precoders(link, rate, scheme, flight.w)
        for link, rate in zip(field.links, field.rates, strict=True)
    ]
    ending = f"stationary to {best.residual:.1e}"
    if not best.converged:
        ending = f"stopped after {best.iterations} steps, {ending}"
    solution = make_solution(
        problem, flight, precoders, [], converged=best.converged, ending=ending
    )
    found = solution.delivered_rate if problem.plan.radio.causal else solution.rates.R_avg
    # values by tables may be above those of the precoders, and without shadowing more is delivered
    history = np.maximum.accumulate([next(iter(begun.values())), *reached.values()])
    gain = None
    if before is not None:
        gain = found - _worth(problem, before.w, [before.P_B, before.P_U])
    return replace(
        solution,
        history=np.append(np.minimum(history, found), found),
        starts={name: min(each, found) for name, each in (reached | ends).items()},
        gain=gain,
    )


def _routes(
    problem: Problem,
    before: Solution | None,
    known: Trajectory | None,
    field: RateField,
    *,
    alone: bool,
) -> dict[str, Trajectory]:
    """Return the flights from which the search starts, by name.

    They are those of `optimizer.starts`, over maps those of `map`; `cutoff`, that of the plan
    for the cutoff rate `before`; and `known`, that of a similar plan, or this `alone`.
    """
    kin, fenced = problem.kinematics, problem.fenced(problem.kinematics)
    stations = {"bs": problem.bs_uav.gains.midway, "user": problem.uav_user.gains.midway}
    names = ("straight",) if alone or problem.mapped else problem.plan.optimizer.starts
    routes = starts_over_map(problem, field) if problem.mapped and not alone else {}
    if not routes:
        routes = starts(kin, names, stations, problem.free_area, fenced)
    if before is not None:
        routes["cutoff"] = before.trajectory
    if known is not None:
        calm = (*constraints_of(kin), *fenced)
        near = feasible(kin, next(iter(routes.values())), _in_time(problem, known), calm)
        routes = {"known": near} if alone else routes | {"known": near}
    if problem.energy < np.inf:
        kept = problem.constraints(kin)
        routes = sparing_starts(kin, routes, (*constraints_of(kin), *kept))
        if not routes:
            raise InfeasibleError("no flight was found that takes so little energy")
    return routes


def _in_time(problem: Problem, flight: Trajectory) -> Real:
    """Return velocities (n, 2) at which the path of `flight` takes the time of `problem`.

    With a least speed they are those of the nearest flight that has it, if one is found.
    """
    kin = problem.kinematics
    slower = paced(kin, flight, kin.time_step)
    if kin.min_speed == 0:
        return slower
    then, now = (np.linspace(0, 1, n) for n in (kin.slots, len(flight.w)))
    path = np.stack([np.interp(then, now, w) for w in flight.w.T], axis=1)
    near = nearest_flight(kin, path, kin.follow(slower), problem.constraints(kin))
    return slower if near is None else near.v


def _best(problem: Problem, field: RateField, optima: list[LocalOptimum]) -> LocalOptimum:
    """Return the best of `optima`; of equal ones that which delivers most, then the first.

    A route and its mirror image have the same R_avg, and may deliver very different amounts.
    """
    most = max(optimum.value for optimum in optima)
    equal = [optimum for optimum in optima if optimum.value > most - EQUAL]

    def delivered(optimum: LocalOptimum) -> float:
        rates = field.value(optimum.trajectory.w.T)
        return round(objective(rates, problem.kinematics, problem.relay) / EQUAL)

    return max(equal, key=delivered)


def _followed(
    problem: Problem,
    field: RateField,
    start: Trajectory,
    steps: int,
    *,
    warm: bool = True,
) -> LocalOptimum:
    """Return what is found from `start`: over maps close by, by the maps as they are."""
    if problem.mapped:
        return improved_over_map(problem, field, start)
    return _maximized(problem, field, start, steps, warm=warm)


def _maximized(
    problem: Problem,
    stage: Stage,
    start: Trajectory,
    max_iterations: int,
    *,
    warm: bool = True,
) -> LocalOptimum:
    """Return what is found from `start`, which is nearly optimal where `warm`."""
    return maximize(
        problem.kinematics,
        stage,
        start,
        constraints=problem.constraints(problem.kinematics),
        tolerance=problem.plan.optimizer.tolerance,
        max_iterations=max_iterations,
        warm=warm,
        relay=problem.maximised_queue,
    )


def _sharpened(
    problem: Problem, scheme: Design, optima: Sequence[LocalOptimum], max_iterations: int
) -> LocalOptimum:
    """Return the best by the steps themselves of `optima` and of those for ever sharper steps."""
    found, now = [*optima], [*optima]
    for width in _WIDTHS:
        field = rate_field(problem, scheme, width)
        now = [_followed(problem, field, each.trajectory, max_iterations) for each in now]
        found += now
    flights = [each.trajectory.w for each in found]
    worth = [_worth(problem, w, _designed(problem, scheme, w)) for w in flights]
    return found[int(np.argmax(worth))]


def _under_shadowing(problem: Problem, field: RateField, optimum: LocalOptimum) -> LocalOptimum:
    """Return the best under shadowing of `optimum` and of those that stay less about one place."""
    begin = optimum.trajectory
    rates = partial(field.value, begin.w.T)
    stages = [tolled(problem, field.smoothed(), begin.w, rates, z) for z in TOLLS]
    found = [optimum, *(_maximized(problem, each, begin, _TOLLED_ITERATIONS) for each in stages)]
    flights = [each.trajectory.w for each in found]
    return found[int(np.argmax([worth(problem, w, partial(field.value, w.T)) for w in flights]))]


def _worth(problem: Problem, w: Real, precoders: Sequence[Complex]) -> float:
    """Return what `problem` maximises, bit/s/Hz, at positions w (n, 2) with both `precoders`."""
    links = zip(problem.links, precoders, strict=True)
    rates = [link.mean_rates(link.channel(w), P) for link, P in links]
    return objective(np.stack(rates), problem.kinematics, problem.maximised_queue)


def _designed(problem: Problem, scheme: Design, w: Real) -> list[Complex]:
    """Return the precoders of both links at w (n, 2) by `scheme`."""
    return [scheme.precoders(link, link.channel(w)) for link in problem.links]


def _precoders(link: Link, rate: RateModel, scheme: Design, w: Real) -> Complex:
    """Return the precoders at positions w (n, 2), searched from the best that `rate` knows.

    With known draws they are searched afresh too, and the better kept.
    """
    H = link.channel(w)
    near = rate.initial_precoders(*link_coordinates(link, w.T)) if scheme.optimal else None
    if near is None:
        return scheme.precoders(link, H)
    if link.measure != "cutoff":
        return near
    carried = scheme.precoders(link, H, start=near)
    if scheme.averaged or link.nlos is None:
        return carried
    afresh = scheme.precoders(link, H)
    better = scheme.rate(link, H, carried) > scheme.rate(link, H, afresh)
    return np.asarray(np.where(better[:, None, None], carried, afresh))
