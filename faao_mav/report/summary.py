"""A result and a validation in words: the lines of the terminal and of the page."""

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np

from faao_mav.optimizer.kinematics import kinematics
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan
from faao_mav.plan.fields import dbm
from faao_mav.report.findings import by_rule, count_of, counted, line_of
from faao_mav.schedule.precoder_table import taken_by
from faao_mav.validate import Level
from faao_mav.validate.check import Check
from faao_mav.validate.demands import LinkCheck
from faao_mav.validate.flown import Debriefing
from faao_mav.validate.wind_limit import LEAST_RATE, MOST_LATE, MOST_WIND, WindLimit
from faao_mav.vector import lengths
from faao_mav.workflow import FenceSummary, Result

Line: TypeAlias = tuple[str, str]
"""A label and a text; a line without a label goes on where the one before it ended."""

_LABEL_WIDTH = 13
"""Characters that a label takes on the terminal."""

_AT_LIMIT = 0.999
"""The share of a limit at which it counts as reached. Chosen."""

_LOSS_TOLD = 0.01
"""Share of R_avg that may be lost on the way before a plan for R_avg is warned about. Chosen."""


def summary(
    result: Result, written: Sequence[Path] = (), precoder_table: Path | None = None
) -> str:
    """Return the text that the main job prints: `result`, and the files that were `written`.

    Of a `precoder_table` among them it says which rows a late aircraft takes.
    """
    lines = [*result_lines(result), *_checked(result)]
    rows = f": a late aircraft takes the row of the {taken_by(result.solution.plan)}"
    lines += [("written", f"{path}{rows if path == precoder_table else ''}") for path in written]
    if not written:
        lines.append(("written", "nothing: give --out MISSION.waypoints"))
    name = result.solution.plan.name
    return "\n".join([*([name] if name else []), joined(lines)])


def joined(lines: Iterable[Line]) -> str:
    """Return `lines` as the terminal shows them."""
    return "\n".join(f"{label:<{_LABEL_WIDTH}}{text}" for label, text in lines)


def result_lines(result: Result, *, timed: bool = True) -> Iterator[Line]:
    """Yield what the optimiser found and how its mission will fly.

    With `timed` it says how long that took, which no two runs have in common.
    """
    solution, plan = result.solution, result.solution.plan
    limit, bound, causal = result.saturation, result.bound, plan.radio.causal
    yield from _least(solution)
    # what was maximised comes first, with how that came about
    yield from (_delivered if causal else _rate)(result)
    yield from (_rate if causal else _delivered)(result)
    yield from _gained(result)
    if bound is not None:
        reached = solution.delivered_rate if causal else solution.rates.R_avg
        short = 100 * (1 - reached / bound.value) if bound.value else 0.0
        yield (
            "bound",
            f"within {short:.2g} % of the best that any route can do: at most "
            f"{_told_rate(bound.value, plan.radio.bandwidth_mhz)}"
            f"{'' if bound.exact else ' (numerical)'}",
        )
    if limit is not None and limit.saturated:
        yield (
            "saturated",
            "the alphabet is used up and the route hardly matters: "
            f"{limit.spare_db:.1f} dB less power at both stations would do",
        )
    if len(solution.starts) > 1:
        ranked = sorted(solution.starts.items(), key=lambda start: start[1])
        (worst, low), (best, high) = ranked[0], ranked[-1]
        yield "starts", f"{len(ranked)}, from {low:.4f} ({worst}) to {high:.4f} ({best}) bit/s/Hz"
    state = "converged" if solution.converged else "NOT CONVERGED"
    seconds = f", {result.seconds_optimize:.1f} s" if timed else ""
    steps = counted(solution.iterations, "iteration")
    yield "optimiser", f"{state} after {steps}{seconds}: {solution.ending}"
    yield from _airspeed(solution)
    yield from _flown(result)
    yield from _wind(plan, result.check)
    yield from _energy(result.check)
    yield from _fenced(result.fence)


def _airspeed(solution: Solution) -> Iterator[Line]:
    """Yield how fast turns and the airspeed change at most, if the plan allows or wants more."""
    kin, allowed = kinematics(solution.plan), solution.plan.vehicle.max_acceleration
    if kin.max_acceleration < allowed:
        yield (
            "turns",
            f"accelerate by at most {kin.max_acceleration:.3g} m/s^2, which the vehicle's guidance "
            f"follows; the plan allows {allowed:g}",
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
        "energy": f"{found.limit:.4g} Wh without",
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


def _told_rate(rate: float, bandwidth_mhz: float | None) -> str:
    """Return `rate`, bit/s/Hz, as text, with a bandwidth in Mbit/s too."""
    megabits = "" if bandwidth_mhz is None else f" ({rate * bandwidth_mhz:.4g} Mbit/s)"
    return f"{rate:.4f} bit/s/Hz{megabits}"


def _carried(megabytes: float | None) -> str:
    return "" if megabytes is None else f", {megabytes:.4g} megabytes"


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
    most = f" of at most {limit.ceiling:g}" if limit else ""
    yield (
        "rate",
        f"{_told_rate(rates.R_avg, plan.radio.bandwidth_mhz)}{most}{_of_measure(plan)} "
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
    most = f" of at most {limit.ceiling:.5g}" if limit else ""
    yield (
        "delivered",
        f"{_told_rate(delivered, plan.radio.bandwidth_mhz)}{most}{_of_measure(plan)}"
        f"{_carried(plan.megabytes(delivered))}; "
        f"{'in half duplex ' if half else ''}{100 * share:.2f} % of the rate",
    )
    if causal:
        yield "", f"{solution.history[0]:.4f} on the straight start"
    elif share < 1 - _LOSS_TOLD:
        why = "both hops share the time, and " if half else ""
        yield (
            "",
            f"warning: {100 * (1 - share):.2g} % of the rate does not arrive: {why}the relay "
            "forwards only what it has received; radio.causal: true plans for what arrives",
        )
    if fresh:
        unseen = "on fading that was not planned on"
        yield "", f"{fresh.delivered:.4f} +- {fresh.delivered_error:.1g} {unseen}"


def _flown(result: Result) -> Iterator[Line]:
    conversion, flown, solution = result.conversion, result.prediction, result.solution
    if result.no_mission is not None:
        yield "mission", f"none: {result.no_mission}"
    if conversion is None or flown is None:
        return
    distance = conversion.schedule.route.distance
    items = counted(len(conversion.mission.items), "item")
    yield "mission", f"{items}; relay route of {distance:.0f} m"
    plan = solution.plan
    lasting = f", in {flown.duration:.1f} s (planned: {plan.flight.duration:g} s)"
    bandwidth = plan.radio.bandwidth_mhz
    delivers = f"delivers {_of_plan(flown.delivered_rate, solution.delivered_rate, bandwidth)}"
    delivers += _carried(plan.megabytes(flown.delivered_rate))
    average = _of_plan(flown.rates.R_avg, solution.rates.R_avg, bandwidth)
    if plan.radio.causal:
        yield "predicted", delivers + lasting
        yield "", f"R_avg {average}"
    else:
        yield "predicted", average + lasting
        yield "", delivers
    yield "", _apart(flown.rms_position_error, flown.max_position_error, flown.max_path_error)
    if doubt := conversion.vehicle.type.caveat:
        yield "", doubt


def _wind(plan: Plan, check: Check | None) -> Iterator[Line]:
    """Yield the plan's wind, if it has one, and which winds its mission keeps."""
    wind, told = plan.site.wind, []
    if any(plan.wind):
        told.append(f"planned for {wind.speed:g} m/s from {wind.from_degrees:g} degrees")
    if wind.gust > wind.speed:
        told.append(f"gusts of {wind.gust:g} m/s")
    if check is not None and check.wind_limit is not None:
        told.append(_of_limit(check.wind_limit, check.link))
    if told:
        yield "wind", "; ".join(told)


def _energy(check: Check | None) -> Iterator[Line]:
    """Yield what the whole predicted flight takes, and what of the battery it leaves."""
    energy = check.energy if check is not None else None
    if energy is None:
        return
    told = f"{energy.total:.4g} Wh for the whole flight"
    if not energy.lands:
        told += " as far as the mission goes, in the air at its end"
    if energy.battery is not None and energy.left is not None:
        battery = energy.battery
        left = f"{100 * energy.left:.0f} %" if energy.left > 0 else "nothing"
        told += f"; {left} of {battery.capacity_wh:g} Wh is left (reserve {battery.reserve:g} %)"
    yield "energy", told


def _of_limit(limit: WindLimit, link: LinkCheck | None) -> str:
    rate = f"{100 * LEAST_RATE:g} % of the rate and " if link is not None else ""
    kept = f"keeps {rate}its time within {MOST_LATE:g} s"
    if any(limit.beside):
        return (
            f"{kept} while the wind is within {limit.speed:g} m/s of the planned one; the worst "
            f"change is wind from {limit.from_degrees:g} degrees"
        )
    if limit.speed == 0:
        return f"{kept} in no wind from {limit.from_degrees:g} degrees"
    if limit.speed >= MOST_WIND:
        return f"{kept} in {MOST_WIND:g} m/s from any direction"
    worst = f"the worst is {limit.from_degrees:g} degrees"
    return f"{kept} up to {limit.speed:g} m/s from any direction; {worst}"


def _fenced(fence: FenceSummary | None) -> Iterator[Line]:
    if fence is None:
        return
    kept = f"the plan keeps {fence.planned_clearance:.1f} m (margin {fence.margin:g} m)"
    if fence.predicted_clearance is not None:
        kept += f", the predicted flight {fence.predicted_clearance:.1f} m"
    yield "fence", f"{counted(fence.areas, 'area')}; {kept} from the edge"


def _of_plan(rate: float, planned: float, bandwidth_mhz: float | None) -> str:
    share = 100 * rate / planned if planned else 100.0
    return f"{_told_rate(rate, bandwidth_mhz)}, {share:.2f} % of the plan"


def check_lines(check: Check) -> Iterator[Line]:
    """Yield what the predicted flight of a mission is, by itself and beside its plan."""
    if check.track is None:
        yield "flight not predicted", check.unpredicted
    else:
        doubt = check.vehicle.type.caveat
        lasting = f"{check.track.t[-1]:.0f} s"
        if any(check.wind):
            lasting = f"{lasting} in {math.hypot(*check.wind):.3g} m/s of wind"
        yield "predicted flight", f"{lasting} ({doubt})" if doubt else lasting
    if check.wind_limit is not None:
        yield "wind", _of_limit(check.wind_limit, check.link)
    yield from _energy(check)
    if link := check.link:
        of_plan = partial(_of_plan, bandwidth_mhz=link.bandwidth_mhz)
        yield (
            "predicted link",
            f"delivers {of_plan(link.predicted_delivered, link.planned_delivered)}"
            f"{_carried(link.predicted_mbytes)}; "
            f"R_avg {of_plan(link.predicted_rate, link.planned_rate)}",
        )
        yield "", _apart(link.rms_position_error, link.max_position_error, link.path_error)


def debriefing_lines(found: Debriefing) -> Iterator[Line]:
    """Yield what became of a plan, hop by hop: planned, predicted and flown."""
    solution, plan = found.solution, found.solution.plan
    bandwidth = plan.radio.bandwidth_mhz
    for name, flight in (("predicted", found.predicted), ("flown", found.flown)):
        late = round(flight.duration - plan.flight.duration, 1) + 0.0  # no minus before 0.0
        yield (
            name,
            f"delivers {_of_plan(flight.delivered_rate, solution.delivered_rate, bandwidth)}"
            f"{_carried(plan.megabytes(flight.delivered_rate))}, in {flight.duration:.1f} s "
            f"({late:+.1f} s)",
        )
        yield "", f"base station to UAV {_of_plan(flight.rates.R_U, solution.rates.R_U, bandwidth)}"
        yield "", f"UAV to user {_of_plan(flight.rates.R_G, solution.rates.R_G, bandwidth)}"
        yield (
            "",
            _apart(flight.rms_position_error, flight.max_position_error, flight.max_path_error),
        )
    yield "height", f"at most {found.altitude_error:.1f} m from the planned one"
    if found.missing > 0:
        yield (
            "incomplete",
            f"of the plan's last {found.missing:.1f} s there is no flight: counted as if the "
            "aircraft had stayed where it was seen last",
        )


def _apart(rms: float, most: float, path: float) -> str:
    """Say how far, m, the predicted flight is from the plan."""
    at_equal_times = f"{rms:.1f} m rms from the plan at equal times, {most:.1f} m at most"
    return f"{at_equal_times}; {path:.1f} m from its path"


def _checked(result: Result) -> Iterator[Line]:
    """Yield what validation found, notes counted and the rest told, and the parameters to load."""
    if result.conversion is None:
        return
    findings = result.findings
    told = [finding for finding in findings if finding.level is not Level.NOTE]
    levels = (Level.ERROR, Level.WARNING) if told else ()
    counts = [count_of(findings, level) for level in levels] or ["no errors or warnings"]
    yield "checked", ", ".join([*counts, count_of(findings, Level.NOTE)])
    for group in by_rule(told):
        yield "", line_of(group)
    if parameters := result.conversion.parameters:
        wanted = ", ".join(f"{name} {value:g}" for name, value in parameters.items())
        yield "parameters", f"the mission is timed for {wanted}: load them first"
