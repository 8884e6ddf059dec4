"""The direct method: one loop over trajectory and precoders on the true rate.

maximise min(R_U, R_G) of (9), (10) under (11)-(13f), or with `radio.causal` what the relay delivers
of both rates: see `interior.queue`. More rate in a slot never delivers less, so that the best
precoders are the same. For given positions the best precoders of
every slot are a problem of their own, so that the rates become functions of the trajectory alone;
by the envelope theorem their gradients are those at the best precoders. What is left is a flight
through two fields of rates, which `interior` solves in time linear in the number of slots.

Measured (benchmarks/direct_against_ipopt.py): never below CasADi + IPOPT from the same
starts, and several times quicker.
"""

import math
from dataclasses import replace

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.design import Design, design
from faao_mav.optimizer.interior.maximize import (
    LocalOptimum,
    constraints_of,
    feasible,
    maximize,
    maximize_all,
    objectives,
)
from faao_mav.optimizer.interior.search import WARM_START
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.problem import Link, Problem, counted_as_cutoff
from faao_mav.optimizer.rates import RateModel, link_coordinates
from faao_mav.optimizer.rates.field import RateField, rate_field
from faao_mav.optimizer.rates.slot_rate import BestRate, FixedRate, unturned
from faao_mav.optimizer.rates.table_rate import TableRate
from faao_mav.optimizer.search.multistart import ImprovedStarts, improve_starts, stretched
from faao_mav.optimizer.search.sparing import sparing_starts
from faao_mav.optimizer.search.starts import by_name, starts
from faao_mav.optimizer.search.ways import starts_inside
from faao_mav.optimizer.solution import Observer, Progress, Solution, make_solution

LONG_SEARCH = 6
"""By how many times `optimizer.max_iterations` may be exceeded where there is a least speed, or a
queue has a buffer or shares. Random plans for planes need up to 250 steps."""

_EXACT_ITERATIONS = 12
"""Iterations at exact rates, after those in a table, at most. Chosen. Measured with QPSK on 2, 3
and 3 antennas and known draws, three seeds: without them the rates are 1 % lower."""

ROUGH = 1e-3
"""The tolerance on R_avg, bit/s/Hz, to which starts are improved before they are compared.

Chosen; what a change costs is not measured.
"""

CUTOFF = "cutoff"
"""The name of the start that a plan for the mutual information has beside `optimizer.starts`: the
flight of the plan for the cutoff rate."""

_EQUAL = 1e-6
"""The difference in bit/s/Hz below which two optima count as equal: which of them is larger is then
up to the tolerance and to rounding, so that it differs from machine to machine. Chosen."""


KNOWN = "known"
"""The name of the start that is the flight of a similar plan."""


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
    options, kin = problem.plan.optimizer, problem.kinematics
    scheme = design(problem.plan)
    counts_cutoff = options.rate == "cutoff" or scheme.gaussian
    before = None if counts_cutoff else direct(counted_as_cutoff(problem))
    relay = problem.maximised_queue
    # these take more steps, as shares and a buffer do
    slow, shared = kin.min_speed > 0, relay is not None and relay.half
    fenced_in = problem.fence is not None
    long = shared or (relay is not None and math.isfinite(relay.buffer))
    long = long or slow or fenced_in or problem.energy < math.inf
    steps = options.max_iterations * (LONG_SEARCH if long else 1)

    def tell(number: int, stage: str, best: float) -> None:
        if observe is not None:
            observe(Progress(number, 2, stage, best))

    tell(0, "rates over the map", 0.0)
    field = rate_field(problem, scheme)
    stations = {"bs": problem.bs_uav.station, "user": problem.uav_user.station}
    kept, fenced = problem.constraints(kin), problem.fenced(kin)
    names = ("straight",) if alone else by_name(options.starts)
    routes = (
        starts_inside(kin, names, stations, problem.free_area, fenced)
        if problem.free_area
        else starts(kin, names, stations)
    )
    if before is not None:
        routes[CUTOFF] = before.trajectory
    if known is not None:
        calm = (*constraints_of(kin), *fenced)
        near = feasible(kin, next(iter(routes.values())), stretched(kin, known), calm)
        routes = {KNOWN: near} if alone else routes | {KNOWN: near}
    if problem.energy < math.inf:
        routes = sparing_starts(kin, routes, (*constraints_of(kin), *kept))
        if not routes:
            raise InfeasibleError("no flight was found that takes so little energy")
    tell(1, "the starts", 0.0)
    if len(routes) > 1:
        rough = improve_starts(
            kin,
            field,
            routes,
            tolerance=ROUGH,
            max_iterations=steps,
            relay=relay,
            constraints=problem.constraints,
            coarse=problem.energy == math.inf,  # the copy cannot make the circles that save energy
        )
    else:  # a single start needs no comparison
        rough = ImprovedStarts(routes, list(routes))
    flights = [*routes.values(), *rough.flights.values()]
    rates = field.value(np.stack([flight.w.T for flight in flights], axis=1))
    values = objectives(rates, kin, relay)
    if scheme.gaussian:
        rates = np.stack([_rates(scheme, field, flight.w) for flight in flights], axis=1)
    reported = objectives(rates, kin, relay).tolist() if scheme.gaussian else values.tolist()
    history = np.maximum.accumulate([reported[0], *reported[len(routes) :]]).tolist()
    tell(2, "the best start", history[-1])

    def optimized(flights: list[Trajectory]) -> list[LocalOptimum]:
        cold = any(flight in routes.values() for flight in flights)
        return maximize_all(
            kin,
            field,
            flights,
            constraints=kept,
            tolerance=options.tolerance,
            max_iterations=steps,
            strategy=None if cold else WARM_START,
            relay=relay,
        )

    optima = optimized([rough.flights[name] for name in rough.promising])
    by_start = dict(zip(routes, reported[len(routes) :], strict=True))
    if not scheme.gaussian:
        by_start |= {name: end.value for name, end in zip(rough.promising, optima, strict=True)}
    if values.max() > max(optimum.value for optimum in optima):
        optima += optimized([flights[int(values.argmax())]])
    best, held = _at_exact_rates(problem, scheme, field, _best(problem, field, optima))
    solution = _solution(problem, scheme, field, best, history, by_start, held)
    if before is None:
        return solution
    return replace(solution, gain=float(solution.history[-1]) - _worth(problem, before))


def _worth(problem: Problem, other: Solution) -> float:
    """Return what `problem` maximises, bit/s/Hz, of the flight and the precoders of `other`."""
    rates = [
        link.rates(other.w, H_r, P)
        for link, H_r, P in zip(
            problem.links, (other.H_rB, other.H_rU), (other.P_B, other.P_U), strict=True
        )
    ]
    values = objectives(np.stack(rates)[:, None], problem.kinematics, problem.maximised_queue)
    return float(values[0])


def _best(problem: Problem, field: RateField, optima: list[LocalOptimum]) -> LocalOptimum:
    """Return the best of `optima`; of equal ones that which delivers most, then the first.

    A route and its mirror image have the same R_avg, and may deliver very different amounts.
    """
    most = max(optimum.value for optimum in optima)
    equal = [optimum for optimum in optima if optimum.value > most - _EQUAL]
    if len(equal) == 1:
        return equal[0]
    rates = field.value(np.stack([optimum.trajectory.w.T for optimum in equal], axis=1))
    delivered = objectives(rates, problem.kinematics, problem.relay)
    return equal[int(np.argmax(np.round(delivered / _EQUAL)))]


def _at_exact_rates(
    problem: Problem, scheme: Design, field: RateField, optimum: LocalOptimum
) -> tuple[LocalOptimum, list[Complex]]:
    """Return `optimum`, taken a little further where it was found in an approximate table.

    With the precoders held, the rates are exact, and whatever they gain the best ones gain too. The
    precoders are returned with it, none where the table is exact.
    """
    approximate = any(
        isinstance(rate, TableRate) and rate.kind == "modes" and not rate.exact
        for rate in field.rates
    )
    if problem.plan.optimizer.rate != "cutoff" or not approximate:
        return optimum, []
    w, kin = optimum.trajectory.w, problem.kinematics
    held = [
        _precoders(link, rate, scheme, w, link.channel(w, link.small_scale(w)))
        for link, rate in zip(field.links, field.rates, strict=True)
    ]
    exact = tuple(
        FixedRate(link, unturned(link, link_coordinates(link, w.T).cosine, P))
        for link, P in zip(field.links, held, strict=True)
    )
    further = maximize(
        kin,
        RateField(field.links, exact),
        optimum.trajectory,
        constraints=problem.constraints(kin),
        tolerance=problem.plan.optimizer.tolerance,
        max_iterations=_EXACT_ITERATIONS,
        strategy=WARM_START,
        relay=problem.maximised_queue,
    )
    return replace(optimum, trajectory=further.trajectory, value=further.value), held


def _rates(scheme: Design, field: RateField, w: Real) -> Real:
    """Return the rates (2, n) at positions w with precoders that are made for Gaussian inputs."""
    rates = []
    for link in field.links:
        H_r = link.small_scale(w)
        rates.append(link.rates(w, H_r, scheme.precoders(link, link.channel(w, H_r))))
    return np.stack(rates)


def _solution(
    problem: Problem,
    scheme: Design,
    field: RateField,
    final: LocalOptimum,
    history: list[float],
    by_start: dict[str, float],
    held: list[Complex],
) -> Solution:
    """Return `final` with its precoders and rates, and how it came about.

    The precoders are searched from those that were `held` on the way, if any were.
    """
    w = final.trajectory.w
    fading, precoders = [], []
    for k, (link, rate) in enumerate(zip(problem.links, field.rates, strict=True)):
        H_r = link.small_scale(w)
        H = link.channel(w, H_r)
        fading.append(H_r)
        precoders.append(
            scheme.precoders(link, H, start=held[k])
            if held
            else _precoders(link, rate, scheme, w, H)
        )
    residual = f"stationary to {final.residual:.1e}"
    solution = make_solution(
        problem,
        final.trajectory,
        _pair(fading),
        _pair(precoders),
        history,
        converged=final.converged,
        ending=residual
        if final.converged
        else f"stopped after {final.iterations} steps, {residual}",
    )
    # Rates read off a table on the way are a little off; the last is not.
    reached = solution.delivered_rate if problem.plan.radio.causal else solution.rates.R_avg
    most = np.inf if scheme.gaussian else reached
    return replace(
        solution,
        history=np.array([*np.minimum(history, most).tolist(), reached]),
        starts={name: min(value, most) for name, value in by_start.items()},
    )


def _precoders(link: Link, rate: RateModel, scheme: Design, w: Real, H: Complex) -> Complex:
    """Return the precoders at positions w (n, 2), searched from the best that `rate` knows.

    From a table of two modes they are searched afresh too, and the better kept; from one of a
    single mode that gained 2e-6 bit in the mean, on twelve random plans.
    """
    where = link_coordinates(link, w.T)
    at = where.gain_log, where.cosine
    if not scheme.optimal or not isinstance(rate, TableRate | BestRate):
        return scheme.precoders(link, H)
    known = rate.initial_precoders(*at)
    if link.measure != "cutoff":
        return known
    carried = scheme.precoders(link, H, start=known)
    if (isinstance(rate, TableRate) and rate.kind == "curve") or (
        min(link.receive, link.transmit) == 1 and not rate.exact
    ):
        return carried
    afresh = scheme.precoders(link, H)
    if rate.exact:
        return afresh
    better = scheme.rate(link, H, carried) > scheme.rate(link, H, afresh)
    return np.asarray(np.where(better[:, None, None], carried, afresh))


def _pair(arrays: list[Complex]) -> tuple[Complex, Complex]:
    """Return the two `arrays` as a pair."""
    first, second = arrays
    return first, second
