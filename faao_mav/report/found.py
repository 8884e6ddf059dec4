"""What the optimiser found, in words: delivered rate, rate, bound, starts and limits."""

import math
from collections.abc import Iterator

import numpy as np

from faao_mav.optimizer.kinematics import kinematics
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan
from faao_mav.plan.fields import dbm
from faao_mav.report.lines import Line, carried, told_rate
from faao_mav.validate.words import counted
from faao_mav.vector import lengths
from faao_mav.workflow import Result

_AT_LIMIT = 0.999
"""The share of a limit at which it counts as reached. Chosen."""

_LOSS_TOLD = 0.01
"""Share of R_avg that may be lost on the way before a plan for R_avg is warned about. Chosen."""


def found_lines(result: Result, *, timed: bool) -> Iterator[Line]:
    """Yield what the optimiser found; with `timed` also how long that took."""
    solution, causal = result.solution, result.solution.plan.radio.causal
    yield from _least(solution)
    # what was maximised comes first, with how that came about
    yield from (_delivered if causal else _rate)(result)
    yield from (_rate if causal else _delivered)(result)
    yield from _gained(result)
    yield from _bounded(result)
    yield from _saturated(result)
    if len(solution.starts) > 1:
        ranked = sorted(solution.starts.items(), key=lambda start: start[1])
        (worst, low), (best, high) = ranked[0], ranked[-1]
        yield "starts", f"{len(ranked)}, from {low:.4f} ({worst}) to {high:.4f} ({best}) bit/s/Hz"
    state = "converged" if solution.converged else "NOT CONVERGED"
    seconds = f", which took {result.seconds_optimize:.1f} s" if timed else ""
    steps = counted(solution.iterations, "iteration")
    yield "optimiser", f"{state} after {steps}{seconds}: {solution.ending}"
    yield from _limits(solution)


def brief_link(result: Result) -> Iterator[Line]:
    """Yield in a line what both hops carry, and the most that their alphabet could."""
    solution, plan, limit = result.solution, result.solution.plan, result.saturation
    rates, most = solution.rates, ""
    if limit is not None:
        most = f"; {limit.ceiling:.5g} at most, by the alphabet"
    average = f"R_avg {rates.R_avg:.4f}, " if not plan.radio.causal else ""
    yield (
        "link",
        f"{average}base station to UAV {rates.R_U:.4f}, UAV to user {rates.R_G:.4f} bit/s/Hz"
        f"{_of_measure(plan)}{most}",
    )
    yield from _lost(result)


def remarkable(result: Result) -> Iterator[Line]:
    """Yield what came of a goal, of a bound that was asked for, and what is out of the ordinary."""
    solution = result.solution
    yield from _least(solution)
    yield from _bounded(result)
    yield from _saturated(result)
    if not solution.converged:
        yield "optimiser", f"NOT CONVERGED: {solution.ending}"
    yield from _limits(solution)


def _bounded(result: Result) -> Iterator[Line]:
    solution, plan, bound = result.solution, result.solution.plan, result.bound
    if bound is None:
        return
    reached = solution.delivered_rate if plan.radio.causal else solution.rates.R_avg
    short = 100 * (1 - reached / bound.value) if bound.value else 0.0
    yield (
        "bound",
        f"within {short:.2g} % of the best that any route can do: at most "
        f"{told_rate(bound.value, plan.radio.bandwidth_mhz)} (estimate)",
    )


def _saturated(result: Result) -> Iterator[Line]:
    limit = result.saturation
    if limit is not None and limit.saturated:
        yield (
            "saturated",
            "the alphabet is used up and the route hardly matters: "
            f"{limit.spare_db:.1f} dB less power at both stations would do",
        )


def _lost(result: Result) -> Iterator[Line]:
    """Yield how much of R_avg does not arrive, of a plan for R_avg that loses much of it."""
    solution, plan = result.solution, result.solution.plan
    R_avg = solution.rates.R_avg
    share = solution.delivered_rate / R_avg if R_avg else 1.0
    if not plan.radio.causal and share < 1 - _LOSS_TOLD:
        why = "both hops share the time, and " if plan.radio.duplex == "half" else ""
        yield (
            "",
            f"warning: {100 * (1 - share):.2g} % of R_avg does not arrive: {why}the relay "
            "forwards only what it has received; radio.causal: true plans for what arrives",
        )


def _limits(solution: Solution) -> Iterator[Line]:
    """Yield how fast turns and the airspeed change at most, where that binds the plan."""
    kin = kinematics(solution.plan)
    if kin.turn_binds:
        turned = lengths(solution.a)[:-1] > _AT_LIMIT * kin.turn_limits(solution.v)
        if turned.any():
            yield (
                "turns",
                f"by at most {math.degrees(kin.most_turn):.3g} degrees per second over ground, as "
                "the vehicle's guidance follows, which binds the plan for "
                f"{kin.time_step * turned.sum():.3g} s",
            )
    speed = lengths(solution.v - kin.wind)
    change, square = np.diff(speed) / kin.time_step, np.diff(speed**2) / (2 * kin.time_step)
    bound = (change < -_AT_LIMIT * kin.most_fall) | (square > _AT_LIMIT * kin.most_power)
    if bound.any():
        yield (
            "airspeed",
            f"falls by at most {kin.most_fall:.2g} m/s^2 and rises by at most "
            f"{kin.most_power / kin.max_speed:.2g}, as the vehicle's does, which binds the plan "
            f"for {kin.time_step * bound.sum():.3g} s",
        )


def _least(solution: Solution) -> Iterator[Line]:
    """Yield what a goal led to, and for a least quantity what one step less would deliver."""
    found, plan = solution.least, solution.plan
    if found is None:
        return
    flights = f"{found.optimizations} flights optimised"
    if plan.goal.energy_wh is not None:
        yield (
            "goal",
            f"most data within {plan.goal.energy_wh:g} Wh: {plan.flight.duration:g} s "
            f"({found.limit:g} s given), {solution.energy_wh:.4g} Wh; {flights}",
        )
        return
    below = found.below
    of = plan.goal.minimise or ""
    limit = {
        "duration": f"{found.limit:g} s given",
        "power": f"{found.limit:g} dBm given",
        "energy": f"{found.limit:.4g} Wh without that goal",
    }[of]
    yield (
        "goal",
        f"least {of} for {_amount(plan, plan.needed_rate)}: {_minimised(solution)} "
        f"({limit}); {flights}",
    )
    if below is None:
        yield "", f"no flight takes less {'energy' if of == 'energy' else 'time'}"
    else:
        delivered = _amount(below.plan, below.delivered_rate)
        yield "", f"{_minimised(below)} would deliver {delivered}"


def _minimised(solution: Solution) -> str:
    """Return how much of what its plan's goal minimises a solution has."""
    plan = solution.plan
    if plan.goal.minimise == "duration":
        return f"{plan.flight.duration:g} s"
    if plan.goal.minimise == "energy":
        return f"{solution.energy_wh:.4g} Wh in {plan.flight.duration:g} s"
    powers = dict.fromkeys(f"{dbm(power):.2f}" for power in plan.powers)
    return f"{' and '.join(powers)} dBm"


def _amount(plan: Plan, rate: float) -> str:
    """Return what `rate`, bit/s/Hz, delivers in the unit of the plan's goal."""
    megabytes = plan.megabytes(rate) if plan.goal.deliver_mbytes is not None else None
    return f"{rate:.4f} bit/s/Hz" if megabytes is None else f"{megabytes:.5g} megabytes"


def _of_measure(plan: Plan) -> str:
    return "" if plan.optimizer.rate == "cutoff" else " of mutual information"


def _gained(result: Result) -> Iterator[Line]:
    """Yield what planning for the mutual information gains, where the plan does that."""
    gain, information = result.solution.gain, result.information
    if gain is None:
        return
    more = f"{gain:.4f} bit/s/Hz more than by the plan for the cutoff rate"
    error = information.error if information else 0.0
    doubt = f", below the error of averages over the noise, {error:.1g}" if gain <= error else ""
    yield "", f"{more}{doubt}"


def _rate(result: Result) -> Iterator[Line]:
    solution, plan = result.solution, result.solution.plan
    rates, information, fresh = solution.rates, result.information, result.fresh
    limit = None if plan.radio.causal else result.saturation
    most = f", at most {limit.ceiling:g} by the alphabet" if limit else ""
    yield (
        "rate",
        f"{told_rate(rates.R_avg, plan.radio.bandwidth_mhz)}{most}{_of_measure(plan)} "
        f"(base station to UAV {rates.R_U:.4f}, UAV to user {rates.R_G:.4f})",
    )
    start = "" if plan.radio.causal else f"{solution.history[0]:.4f} on the straight start"
    priced = ""
    if information is not None:
        priced = (
            f"mutual information {information.average:.3f} +- {information.error:.1g}, "
            f"{information.delivered:.3f} delivered"
        )
    if start or priced:
        yield "", "; ".join(filter(None, (start, priced)))
    if fresh and not plan.radio.causal:
        yield "", f"{fresh.average:.4f} +- {fresh.error:.1g} on fading that was not planned on"


def _delivered(result: Result) -> Iterator[Line]:
    solution, plan, fresh = result.solution, result.solution.plan, result.fresh
    delivered, R_avg, causal = solution.delivered_rate, solution.rates.R_avg, plan.radio.causal
    half = plan.radio.duplex == "half"
    share = delivered / R_avg if R_avg else 1.0
    limit = result.saturation if causal else None
    most = f", at most {limit.ceiling:.5g} by the alphabet" if limit else ""
    yield (
        "delivered",
        f"{told_rate(delivered, plan.radio.bandwidth_mhz)}{most}{_of_measure(plan)}"
        f"{carried(plan.megabytes(delivered))}; "
        f"{'in half duplex ' if half else ''}{100 * share:.2f} % of R_avg",
    )
    if causal:
        yield "", f"{solution.history[0]:.4f} on the straight start"
    yield from _lost(result)
    if fresh:
        unseen = "on fading that was not planned on"
        yield "", f"{fresh.delivered:.4f} +- {fresh.delivered_error:.1g} {unseen}"
