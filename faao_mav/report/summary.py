"""A planned flight, and a mission that was checked, in words: for the terminal and both pages."""

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from faao_mav.errors import counted
from faao_mav.optimizer.shadowing import worth
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan
from faao_mav.plan.fields import dbm
from faao_mav.schedule.prediction import Prediction
from faao_mav.validate import Check, Level
from faao_mav.validate.demands import LATE_START
from faao_mav.validate.rule import by_rule, count_of, line_of
from faao_mav.vector import lengths
from faao_mav.workflow import Result

_LOSS_TOLD = 0.01  # share of R_avg that is lost before a plan for R_avg is warned about. Chosen
_MOST_ZONES = 12  # zones of a fence that are named: a few lines. Chosen
_LABEL_WIDTH = 13  # characters that a label takes on the terminal

Line: TypeAlias = tuple[str, str]
"""A label and a text; a line without a label goes on where the one before it ended."""

_RESEARCH = ("delivered", "information", "new fading", "starts", "optimiser", "predicted")
"""Labels of what is told with --verbose alone, with the lines that go on from them."""


def joined(lines: Iterable[Line]) -> str:
    """Return `lines` as the terminal shows them."""
    return "\n".join(f"{label:<{_LABEL_WIDTH}}{text}" for label, text in lines)


def summary(result: Result, written: Sequence[Path] = (), *, verbose: bool = False) -> str:
    """Return the text that the main job prints: `result`, and the files that were `written`.

    The first line is for who flies: what arrives, in how long, whether the mission keeps it and
    whether anything is wrong. `verbose` adds what a researcher looks at.
    """
    lines: list[Line] = []
    topic = ""
    for label, text in result_lines(result):
        topic = label or topic
        failed = topic == "optimiser" and not result.solution.converged
        if verbose or failed or topic not in _RESEARCH:
            lines.append((label, text))
    lines += _checked(result)
    names = ", ".join(map(str, written)) or "none: give --out MISSION.waypoints"
    lines.append(("files", names))
    return "\n".join([_headline(result), joined(lines)])


def result_lines(result: Result, *, timed: bool = True) -> Iterator[Line]:
    """Yield what the optimiser found and how its mission will fly.

    With `timed` it says how long that took, which no two runs have in common.
    """
    solution, plan = result.solution, result.solution.plan
    yield from _goal(solution)
    yield from _height(solution)
    yield from _rates(result)
    yield from _optimum(result, timed)
    yield from _mission(result)
    wind, told = plan.site.wind, list[str]()
    if wind.speed:
        told.append(f"planned for {wind.speed:g} m/s from {wind.from_degrees:g} degrees")
    if wind.gust > wind.speed:
        told.append(f"gusts of {wind.gust:g} m/s")
    if told:
        yield "wind", "; ".join(told)
    yield from _moving(solution, result.check)
    yield from _energy(result.check)
    yield from _fenced(result)


def check_lines(check: Check) -> Iterator[Line]:
    """Yield what the predicted flight of a mission is, by itself and beside its plan."""
    if check.track is None:
        yield "flight not predicted", check.unpredicted
    else:
        lasting = f"{check.track.t[-1]:.0f} s"
        if any(check.wind):
            lasting = f"{lasting} in {math.hypot(*check.wind):.3g} m/s of wind"
            if not check.vehicle.type.models_wind:
                lasting += ", as in calm air: its model leaves wind out"
        yield "predicted flight", f"{lasting}; {check.vehicle.assumption}"
    yield from _energy(check)
    if link := check.link:
        bandwidth = link.bandwidth_mhz
        delivered = _of_plan(link.predicted_delivered, link.planned_delivered, bandwidth)
        delivered += _megabytes(link.predicted_mbytes)
        average = _of_plan(link.predicted_rate, link.planned_rate, bandwidth)
        yield "predicted link", f"delivers {delivered}; R_avg {average}"
        yield "", _apart(link.rms_position_error, link.max_position_error, link.path_error)


def beside(solution: Solution, flight: Prediction) -> Iterator[str]:
    """Yield what a flight delivers, what its hops carry and how far it is from the plan."""
    plan, planned, rates = solution.plan, solution.rates, flight.rates
    bandwidth = plan.radio.bandwidth_mhz
    delivers = _of_plan(flight.delivered_rate, solution.delivered_rate, bandwidth)
    delivers += _megabytes(plan.megabytes(flight.delivered_rate))
    late = flight.duration - plan.flight.duration
    yield f"delivers {delivers}, in {flight.duration:.1f} s ({late:+z.1f} s)"
    yield f"base station to UAV {_of_plan(rates.R_U, planned.R_U, bandwidth)}"
    yield f"UAV to user {_of_plan(rates.R_G, planned.R_G, bandwidth)}"
    yield _apart(flight.rms_position_error, flight.max_position_error, flight.max_path_error)


def _headline(result: Result) -> str:
    """Return what arrives, in how long, how much of it by the mission, and what is wrong."""
    solution, plan = result.solution, result.solution.plan
    rate, lasting = solution.delivered_rate, f"{plan.flight.duration:g} s"
    megabytes, megabits = plan.megabytes(rate), plan.megabits(rate)
    told = f"delivers {rate:.4f} bit/s/Hz for {lasting}"
    if megabytes is not None:
        told = f"delivers {megabytes:.4g} megabytes in {lasting} ({megabits:.4g} Mbit/s)"
    told += "" if solution.converged else " (NOT CONVERGED)"
    told = f"{plan.name}: {told}" if plan.name else told
    if result.no_mission is not None:
        return f"{told}; there is no mission for it"
    if result.prediction is None:
        return f"{told}; {_wrong(result)}" if result.findings else told
    share = result.prediction.delivered_rate / rate if rate else 1.0
    return f"{told}; the mission keeps {100 * share:.2f} % of it; {_wrong(result)}"


def _wrong(result: Result) -> str:
    found = {finding.level for finding in result.findings} - {Level.NOTE}
    counts = [count_of(result.findings, level) for level in Level if level in found]
    return ", ".join(counts) or "no errors or warnings"


def _checked(result: Result) -> Iterator[Line]:
    """Yield what validation found, notes counted and the rest told, and the parameters to load."""
    if result.conversion is None:
        return
    findings = result.findings
    yield "checks", f"{_wrong(result)}, {count_of(findings, Level.NOTE)}"
    for group in by_rule([each for each in findings if each.level is not Level.NOTE]):
        yield "", line_of(group)
    if parameters := result.conversion.parameters:
        wanted = ", ".join(f"{name} {value:g}" for name, value in parameters.items())
        yield "parameters", f"the mission is timed for {wanted}: load them first"


def _rates(result: Result) -> Iterator[Line]:
    """Yield the planned rates, what of them arrives, and by which other measures."""
    solution, plan, information = result.solution, result.solution.plan, result.information
    rates, delivered, radio = solution.rates, solution.delivered_rate, plan.radio
    half, share = radio.duplex == "half", delivered / rates.R_avg if rates.R_avg else 1.0
    limiting = "alphabet" if solution.problem.uav_user.steps is None else "radio's rates"
    ceiling = min(link.most for link in solution.problem.links)
    most = f", at most {ceiling:.5g} by the {limiting}" if result.saturation else ""
    measure = "" if plan.optimizer.rate == "cutoff" else " of mutual information"
    hops = f"base station to UAV {rates.R_U:.4f}, UAV to user {rates.R_G:.4f}"
    yield "rate", f"{_told_rate(rates.R_avg, radio.bandwidth_mhz)}{most}{measure} ({hops})"
    if not radio.causal and share < 1 - _LOSS_TOLD:
        told = f"warning: {100 * (1 - share):.2g} % of R_avg does not arrive: "
        told += "both hops share the time, and the relay " if half else "the relay "
        told += "forwards only what it has received; radio.causal: true plans for what arrives"
        yield "", told
    told = _told_rate(delivered, radio.bandwidth_mhz) + _megabytes(plan.megabytes(delivered))
    yield "delivered", f"{told}; {'in half duplex ' * half}{100 * share:.2f} % of R_avg"
    if (under := result.shadowed) is not None:
        arrives = under.quantiles
        told = f"{_told_rate(arrives[0.1], radio.bandwidth_mhz)} or more arrives in nine of ten "
        told += f"shadowings, {arrives[0.5]:.4f} in half of them, {under.mean:.4f} in the mean"
        yield "shadowing", told
        if (kept := radio.reliability) is not None:
            told = f"planned for what arrives in {100 * kept:g} % of them"
            yield "", f"{told}: {under.worth:.4f} bit/s/Hz"
    if information is not None:
        told = f"mutual information {information.average:.3f} +- {information.error:.1g}"
        yield "information", f"{told}, {information.delivered:.3f} delivered"
    if solution.gain is not None:
        error = information.error if information else 0.0
        told = f"{solution.gain:.4f} bit/s/Hz more than by the plan for the cutoff rate"
        doubt = f", below the error of averages over the noise, {error:.1g}"
        yield "", told + doubt * (solution.gain <= error)
    if fresh := result.fresh:
        told = f"{fresh.delivered:.4f} +- {fresh.delivered_error:.1g} bit/s/Hz delivered, R_avg "
        told += f"{fresh.average:.4f} +- {fresh.error:.1g}, on draws that were not planned on"
        yield "new fading", told


def _optimum(result: Result, timed: bool) -> Iterator[Line]:
    """Yield how near the flight is to the best, what limits it, and how it was found."""
    solution, radio = result.solution, result.solution.plan.radio
    if result.bound is not None:
        reached, value = solution.maximised, result.bound.value
        short = 100 * (1 - reached / value) if value else 0.0
        most = f"at most {_told_rate(value, radio.bandwidth_mhz)} (estimate)"
        yield "bound", f"within {short:.2g} % of the best that any route can do: {most}"
    if result.saturation is not None and result.saturation.saturated:
        stairs = solution.problem.uav_user.steps is not None
        told = "the highest rate is had" if stairs else "the alphabet is used up"
        less = f"{result.saturation.spare_db:.1f} dB less power at both stations would do"
        yield "saturated", f"{told} and the route hardly matters: {less}"
    if len(solution.starts) > 1:
        (worst, low), *_, (best, high) = sorted(solution.starts.items(), key=lambda each: each[1])
        told = f"{len(solution.starts)}, from {low:.4f} ({worst}) to {high:.4f} ({best}) bit/s/Hz"
        yield "starts", told
    told = "converged" if solution.converged else "NOT CONVERGED"
    told += f" after {counted(solution.iterations, 'iteration')}"
    told += f", which took {result.seconds_optimize:.1f} s" if timed else ""
    yield "optimiser", f"{told}: {solution.ending}"
    yield "", f"{solution.history[0]:.4f} bit/s/Hz on the straight start"


def _mission(result: Result) -> Iterator[Line]:
    conversion, flown = result.conversion, result.prediction
    if result.no_mission is not None:
        yield "mission", f"none: {result.no_mission}"
    if conversion is None or flown is None:
        return
    *carried, near = beside(result.solution, flown)
    items = counted(len(conversion.mission.items), "item")
    way = f"{conversion.schedule.route.distance:.0f} m in {flown.duration:.1f} s"
    yield "mission", f"{items}; relay route of {way}"
    yield "", f"predicted {near}"
    yield "", conversion.vehicle.assumption
    yield from zip(("predicted", "", ""), carried, strict=True)


def _goal(solution: Solution) -> Iterator[Line]:
    """Yield what a goal led to, and for a least quantity what one step less would deliver."""
    plan, goal = solution.plan, solution.plan.goal
    if (found := solution.least) is None:
        return
    flights = f"{counted(found.optimizations, 'flight')} optimised"
    share, under = plan.radio.reliability, ""
    if any(plan.radio.spreads):
        under = f" in {share:g} of shadowings" if share else " in the mean over shadowings"
    if goal.energy_wh is not None:
        told = f"most data{under} within {goal.energy_wh:g} Wh: {plan.flight.duration:g} s "
        yield "goal", f"{told}({found.limit:g} s given), {solution.energy_wh:.4g} Wh; {flights}"
        return
    energy = goal.minimise == "energy"
    unit = "dBm given" if goal.minimise == "power" else "s given"
    limit = f"{found.limit:.4g} Wh without that goal" if energy else f"{found.limit:g} {unit}"
    told = (
        f"least {goal.minimise} for {_asked(plan, plan.needed_rate)}{under}: {_brought(solution)}"
    )
    yield "goal", f"{told} ({limit}); {flights}"
    if (below := found.below) is None:
        yield "", f"no flight takes less {'energy' if energy else 'time'}"
    else:
        delivered = _asked(below.plan, worth(below))
        yield "", f"{_brought(below)} would deliver {delivered}"


def _height(solution: Solution) -> Iterator[Line]:
    if (found := solution.height) is None:
        return
    low, high = (
        f"{'no flight' if end is None else _brought(end)} at {at:g} m"
        for at, end in ((found.least, found.at_least), (found.most, found.at_most))
    )
    yield "height", f"{solution.plan.flight.altitude:g} m for {_brought(solution)}; {low}, {high}"


def _brought(solution: Solution) -> str:
    """Return how much of what its plan's goal minimises or maximises a solution has."""
    plan, goal = solution.plan, solution.plan.goal
    if goal.minimise == "duration":
        return f"{plan.flight.duration:g} s"
    if goal.minimise == "energy":
        return f"{solution.energy_wh:.4g} Wh in {plan.flight.duration:g} s"
    if goal.minimise == "power":
        return f"{' and '.join(dict.fromkeys(f'{dbm(power):.2f}' for power in plan.powers))} dBm"
    if goal.maximise == "data":
        return f"{solution.delivered_rate * plan.flight.duration:.5g} bit/Hz"
    return f"{solution.maximised:.4f} bit/s/Hz"


def _asked(plan: Plan, rate: float) -> str:
    """Return what `rate`, bit/s/Hz, delivers in the unit of the plan's goal."""
    megabytes = plan.megabytes(rate) if plan.goal.deliver_mbytes is not None else None
    return f"{rate:.4f} bit/s/Hz" if megabytes is None else f"{megabytes:.5g} megabytes"


def _moving(solution: Solution, check: Check | None) -> Iterator[Line]:
    told = []
    for name, station in zip(("base", "user"), solution.plan.radio.stations, strict=True):
        if station.moves:
            way = station.at(solution.t)
            (x, y), (to_x, to_y) = way[0], way[-1]
            gone = lengths(np.diff(way, axis=0)).sum()
            told.append(f"{name} {gone:.0f} m from [{x:.0f}, {y:.0f}] to [{to_x:.0f}, {to_y:.0f}]")
    if told:
        yield "moving", "; ".join(told)
    if check is not None and check.link is not None and check.link.late_share is not None:
        late = f"met {LATE_START:g} s late, the plan delivers {100 * check.link.late_share:.1f} %; "
        yield "", f"{late}it begins {check.link.begins:.0f} s after the mission"


def _energy(check: Check | None) -> Iterator[Line]:
    if check is None or (energy := check.energy) is None:
        return
    told = f"{energy.total:.4g} Wh for the whole flight"
    if not energy.lands:
        told += " as far as the mission goes, in the air at its end"
    if (battery := energy.battery) is not None and energy.left is not None:
        left = f"{100 * energy.left:.0f} %" if energy.left > 0 else "nothing"
        told += f"; {left} of {battery.capacity_wh:g} Wh is left (reserve {battery.reserve:g} %)"
    yield "energy", told


def _fenced(result: Result) -> Iterator[Line]:
    if (fence := result.fence) is None:
        return
    zones = fence["zones"]
    more = f" and {len(zones) - _MOST_ZONES} more" if len(zones) > _MOST_ZONES else ""
    yield "fence", f"{', '.join(zones[:_MOST_ZONES])}{more}"
    yield from (("", note) for note in fence["notes"])
    kept = f"the plan keeps {fence['planned_clearance']:.1f} m (margin {fence['margin']:g} m)"
    if fence["predicted_clearance"] is not None:
        kept += f", the predicted flight {fence['predicted_clearance']:.1f} m"
    yield "", f"{kept} from the edge"


def _told_rate(rate: float, bandwidth_mhz: float | None) -> str:
    megabits = "" if bandwidth_mhz is None else f" ({rate * bandwidth_mhz:.4g} Mbit/s)"
    return f"{rate:.4f} bit/s/Hz{megabits}"


def _of_plan(rate: float, planned: float, bandwidth_mhz: float | None) -> str:
    share = 100 * rate / planned if planned else 100.0
    return f"{_told_rate(rate, bandwidth_mhz)}, {share:.2f} % of the plan"


def _megabytes(amount: float | None) -> str:
    """Return what is delivered as the end of a sentence, nothing where no bandwidth is given."""
    return "" if amount is None else f", {amount:.4g} megabytes"


def _apart(rms: float, most: float, path: float) -> str:
    at_equal_times = f"{rms:.1f} m rms from the plan at equal times, {most:.1f} m at most"
    return f"{at_equal_times}; {path:.1f} m from its path"
