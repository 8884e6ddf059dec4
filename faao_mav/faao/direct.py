"""The direct method: one loop over trajectory and precoders on the true rate.

maximise min(R_U, R_G) of (9), (10) under (11)-(13f). For given positions the best precoders of
every slot are a problem of their own, so that the rates become functions of the trajectory alone;
by the envelope theorem their slopes are those at the best precoders. What is left is a flight
through two fields of rates, which `interior` solves in time linear in the number of slots.
"""

from dataclasses import dataclass, replace

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.faao.coarse import rejected
from faao_mav.faao.design import Design, design
from faao_mav.faao.interior import Optimum, StageValues, maximize
from faao_mav.faao.mode_rate import ModeRate
from faao_mav.faao.place import PlaceRate, by_position, coordinates, place
from faao_mav.faao.problem import Link, Problem
from faao_mav.faao.progress import Observer, Progress
from faao_mav.faao.rate_model import CurveRate, rate_model
from faao_mav.faao.routes import starts
from faao_mav.faao.slot_rate import BestRate, FixedRate
from faao_mav.faao.solution import Solution, make_solution

_POLISH = 12
"""Steps at most at exact rates, after those in a table."""

_ROUGH = 1e-3
"""Tolerance with which starts are compared, in shares of the best rate."""


@dataclass(frozen=True, slots=True, eq=False)
class RateField:
    """Both links' rates over the map: what `interior` maximises the smaller mean of."""

    links: tuple[Link, ...]
    rates: tuple[PlaceRate, ...]

    def value(self, w: Real) -> Real:
        """Return the rates (2, n) at positions w (n, 2), bits."""
        pairs = zip(self.links, self.rates, strict=True)
        return np.stack([rate.value(*coordinates(link, w)) for link, rate in pairs])

    def __call__(self, w: Real) -> StageValues:
        """Return rates, gradients and Hessians at positions w (n, 2): bits, per m, per m²."""
        values, gradients, hessians = [], [], []
        for link, rate in zip(self.links, self.rates, strict=True):
            at = place(link, w)
            partials = rate.partials(at.gain_log, at.cosine)
            gradient, hessian = by_position(at, partials)
            values.append(partials.value)
            gradients.append(gradient)
            hessians.append(hessian)
        return StageValues(np.stack(values), np.stack(gradients), np.stack(hessians))


def direct(problem: Problem, *, observe: Observer | None = None) -> Solution:
    """Optimise trajectory and precoders of `problem` together.

    The starts of `optimizer.starts` that `coarse` does not reject are improved roughly, the best
    one to the end. The result is never worse than any of those. Raises `InfeasibleError` when
    there is no flight at all.
    """
    options, kin = problem.plan.optimizer, problem.kinematics
    wanted = design(problem.plan)
    stations = {"bs": problem.bs_uav.station, "user": problem.uav_user.station}

    def tell(number: int, stage: str, best: float) -> None:
        if observe is not None:
            observe(Progress(number, len(options.starts) + 1, stage, best))

    tell(0, "rates over the map", 0.0)
    field = rate_field(problem, wanted)
    spread = rejected(
        kin,
        field,
        options.starts,
        stations,
        tolerance=_ROUGH,
        max_iterations=options.max_iterations,
    )
    hopeful = [name for name in options.starts if name not in spread]
    if wanted.gaussian:  # coarse values are not priced with the alphabet
        spread = {}
    routes = starts(kin, hopeful, stations)
    history: list[float] = []
    best: Optimum | None = None
    for number, (name, flight) in enumerate(routes.items(), start=len(spread) + 1):
        history = history or [_counted(field, wanted, flight.w)]
        tell(number, f"start {name}", max(history))
        found = maximize(
            kin, field, flight, tolerance=_ROUGH, max_iterations=options.max_iterations
        )
        spread[name] = _counted(field, wanted, found.trajectory.w)
        if best is None or found.value > best.value:
            best = found
        history.append(_counted(field, wanted, best.trajectory.w))
    assert best is not None
    # in the plan's order; a coarse copy may promise a little too much
    most = max(spread[name] for name in routes)
    order = dict.fromkeys((*options.starts, *routes))
    spread = {name: min(spread[name], most) for name in order if name in spread}
    tell(len(spread) + 1, "the best start", max(history))
    final = maximize(
        kin,
        field,
        best.trajectory,
        tolerance=options.tolerance,
        max_iterations=options.max_iterations,
    )
    final = _polished(problem, wanted, field, final)
    return _solution(problem, wanted, field, final, history, spread)


def _polished(problem: Problem, wanted: Design, field: RateField, found: Optimum) -> Optimum:
    """Take `found` a little further at exact rates where it was found in a table of searches.

    With the precoders held, the rates are exact, and whatever they gain the best ones gain too.
    """
    if not any(isinstance(rate, ModeRate) and not rate.table.exact for rate in field.rates):
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


def _counted(field: RateField, wanted: Design, w: Real) -> float:
    """R_avg of (9) at positions w: by the field, or, if that is for Gaussian inputs, priced."""
    if not wanted.gaussian:
        return float(field.value(w).mean(axis=1).min())
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


def _precoders(link: Link, rate: PlaceRate, wanted: Design, w: Real, H: Complex) -> Complex:
    """The precoders at the final positions, from the best start that is known for them."""
    at = coordinates(link, w)
    if isinstance(rate, CurveRate) and wanted.optimal:
        return wanted.precoders(link, H, start=rate.start(*at))
    found = wanted.precoders(link, H)
    if not isinstance(rate, BestRate | ModeRate):
        return found
    carried = wanted.precoders(link, H, start=rate.start(*at))
    better = wanted.rate(link, H, carried) > wanted.rate(link, H, found)
    return np.asarray(np.where(better[:, None, None], carried, found))


def _pair(arrays: list[Complex]) -> tuple[Complex, Complex]:
    first, second = arrays
    return first, second
