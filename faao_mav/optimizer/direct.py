"""The direct method: one loop over trajectory and precoders on the true rate.

maximise min(R_U, R_G) of (9), (10) under (11)-(13f). For given positions the best precoders of
every slot are a problem of their own, so that the rates become functions of the trajectory alone;
by the envelope theorem their slopes are those at the best precoders. What is left is a flight
through two fields of rates, which `interior` solves in time linear in the number of slots.
"""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.design import Design, design
from faao_mav.optimizer.interior.maximize import (
    FAR,
    NEAR,
    Optimum,
    StageValues,
    maximize,
    maximize_all,
)
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.problem import Link, Problem
from faao_mav.optimizer.progress import Observer, Progress
from faao_mav.optimizer.rates import RateModel, link_coordinates
from faao_mav.optimizer.rates.mode_rate import ModeRate
from faao_mav.optimizer.rates.rate_model import CurveRate, rate_model
from faao_mav.optimizer.rates.slot_rate import BestRate, FixedRate
from faao_mav.optimizer.search.multistart import improve_starts
from faao_mav.optimizer.search.starts import starts
from faao_mav.optimizer.solution import Solution, make_solution

_POLISH = 12
"""Steps at most at exact rates, after those in a table."""

_ROUGH = 1e-3
"""Tolerance with which starts are compared."""


@dataclass(frozen=True, slots=True, eq=False)
class RateField:
    """Both links' rates over the map: what `interior` maximises the smaller mean of."""

    links: tuple[Link, ...]
    rates: tuple[RateModel, ...]

    def value(self, w: Real) -> Real:
        """Return the rates (2, ..., n) at positions w (2, ..., n), bits."""
        found = []
        for link, rate in zip(self.links, self.rates, strict=True):
            at = link_coordinates(link, w)
            found.append(rate.value(at.gain_log, at.cosine))
        return np.stack(found)

    def __call__(self, w: Real) -> StageValues:
        """Return rates, gradients and Hessians at positions w (2, ..., n), as `Stage` has them."""
        shape = (len(self.links), *w.shape[1:])
        value, gradient, hessian = np.empty(shape), np.empty((2, *shape)), np.empty((3, *shape))
        for j, (link, rate) in enumerate(zip(self.links, self.rates, strict=True)):
            at = link_coordinates(link, w)
            partials = rate.partials(at.gain_log, at.cosine)
            value[j] = partials.value
            gradient[:, j], hessian[:, j] = at.by_position(partials)
        return StageValues(value, gradient, hessian)


def direct(problem: Problem, *, observe: Observer | None = None) -> Solution:
    """Optimise trajectory and precoders of `problem` together.

    The starts of `optimizer.starts` are improved roughly, the best to the end. The result is
    never worse than any of them. Raises `InfeasibleError` when there is no flight at all.
    """
    options, kin = problem.plan.optimizer, problem.kinematics
    wanted = design(problem.plan)

    def tell(number: int, stage: str, best: float) -> None:
        if observe is not None:
            observe(Progress(number, 2, stage, best))

    tell(0, "rates over the map", 0.0)
    field = rate_field(problem, wanted)
    stations = {"bs": problem.bs_uav.station, "user": problem.uav_user.station}
    routes = starts(kin, options.starts, stations)
    tell(1, "the starts", 0.0)
    rough = improve_starts(
        kin, field, routes, tolerance=_ROUGH, max_iterations=options.max_iterations
    )
    flights = [*routes.values(), *rough.flights.values()]
    worth = field.value(np.stack([flight.w.T for flight in flights], axis=1)).mean(axis=-1)
    worth = worth.min(axis=0)
    counted = [_priced(wanted, field, f.w) for f in flights] if wanted.gaussian else worth.tolist()
    history = np.maximum.accumulate([counted[0], *counted[len(routes) :]]).tolist()
    tell(2, "the best start", history[-1])

    def finished(near: list[Trajectory]) -> list[Optimum]:
        # the half-planes of a least speed turn too fast for short steps to follow
        begun_afresh = kin.min_speed > 0 or any(flight in routes.values() for flight in near)
        return maximize_all(
            kin,
            field,
            near,
            tolerance=options.tolerance,
            max_iterations=options.max_iterations,
            opening=FAR if begun_afresh else NEAR,
        )

    ends = finished([rough.flights[name] for name in rough.promising])
    spread = dict(zip(routes, counted[len(routes) :], strict=True))
    if not wanted.gaussian:
        spread |= {name: end.value for name, end in zip(rough.promising, ends, strict=True)}
    if worth.max() > max(end.value for end in ends):
        ends += finished([flights[int(worth.argmax())]])
    final = _polished(problem, wanted, field, max(ends, key=lambda end: end.value))
    return _solution(problem, wanted, field, final, history, spread)


def _polished(problem: Problem, wanted: Design, field: RateField, found: Optimum) -> Optimum:
    """Take `found` a little further at exact rates where it was found in a table of searches.

    With the precoders held, the rates are exact, and whatever they gain the best ones gain too.
    """
    if not any(isinstance(rate, ModeRate) and not rate.exact for rate in field.rates):
        return found
    w = found.trajectory.w
    held = []
    for link, rate in zip(field.links, field.rates, strict=True):
        H = link.channel(w, link.small_scale(w))
        held.append(FixedRate(link, _precoders(link, rate, wanted, w, H)))
    polished = maximize(
        problem.kinematics,
        RateField(field.links, tuple(held)),
        found.trajectory,
        tolerance=problem.plan.optimizer.tolerance,
        max_iterations=_POLISH,
    )
    return replace(found, trajectory=polished.trajectory, value=polished.value)


def _priced(wanted: Design, field: RateField, w: Real) -> float:
    """R_avg of (9) at positions w with precoders that are made for Gaussian inputs."""
    means = []
    for link in field.links:
        H_r = link.small_scale(w)
        means.append(link.rates(w, H_r, wanted.precoders(link, link.channel(w, H_r))).mean())
    return float(min(means))


def rate_field(problem: Problem, wanted: Design) -> RateField:
    """Return the rates of `problem` under the design `wanted` as functions of the position."""
    kin = problem.kinematics
    reach = kin.max_speed * kin.time_step * (kin.slots - 1)
    rates = []
    for link in problem.links:
        from_ends = max(np.linalg.norm(end - link.station) for end in (kin.start, kin.end))
        rates.append(rate_model(link, wanted, float(from_ends) + reach / 2))
    return RateField(problem.links, tuple(rates))


def _solution(
    problem: Problem,
    wanted: Design,
    field: RateField,
    final: Optimum,
    history: list[float],
    spread: dict[str, float],
) -> Solution:
    w = final.trajectory.w
    fading, precoders = [], []
    for link, rate in zip(problem.links, field.rates, strict=True):
        H_r = link.small_scale(w)
        fading.append(H_r)
        precoders.append(_precoders(link, rate, wanted, w, link.channel(w, H_r)))
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
        starts=spread,
    )
    # Rates read off a table on the way are a little off; the last is not.
    reached = solution.rates.R_avg
    honest = history if wanted.gaussian else np.minimum(history, reached).tolist()
    return replace(solution, history=np.array([*honest, reached]))


def _precoders(link: Link, rate: RateModel, wanted: Design, w: Real, H: Complex) -> Complex:
    """The precoders at the final positions, from the best start that is known for them."""
    where = link_coordinates(link, w.T)
    at = where.gain_log, where.cosine
    if isinstance(rate, CurveRate) and wanted.optimal:
        return wanted.precoders(link, H, start=rate.initial_precoders(*at))
    found = wanted.precoders(link, H)
    if not isinstance(rate, BestRate | ModeRate) or rate.exact:
        return found
    carried = wanted.precoders(link, H, start=rate.initial_precoders(*at))
    better = wanted.rate(link, H, carried) > wanted.rate(link, H, found)
    return np.asarray(np.where(better[:, None, None], carried, found))


def _pair(arrays: list[Complex]) -> tuple[Complex, Complex]:
    first, second = arrays
    return first, second
