"""Flights in words: predicted and flown, beside their plan, in wind, with their energy."""

import math
from collections.abc import Iterator
from functools import partial

from faao_mav.plan import Plan
from faao_mav.report.lines import Line, apart, carried, of_plan
from faao_mav.validate.check import Check
from faao_mav.validate.flown import Debriefing
from faao_mav.validate.words import counted
from faao_mav.workflow import FenceSummary, Result

_MOST_ZONES = 12
"""Zones of a fence that are named; chosen to fit a few lines."""


def flight_lines(result: Result) -> Iterator[Line]:
    """Yield how the mission of `result` will fly: beside its plan, in wind, energy and fence."""
    yield from _mission(result)
    yield from conditions(result)


def brief_flight(result: Result) -> Iterator[Line]:
    """Yield in a line what the mission of `result` is, and how near its flight is to the plan."""
    conversion, flown = result.conversion, result.prediction
    if result.no_mission is not None:
        yield "mission", f"none: {result.no_mission}"
    if conversion is None or flown is None:
        return
    items = counted(len(conversion.mission.items), "item")
    way = f"{conversion.schedule.route.distance:.0f} m in {flown.duration:.1f} s"
    yield (
        "flight",
        f"{items}, {way}; predicted {flown.rms_position_error:.1f} m rms from the plan at equal "
        f"times, {flown.max_position_error:.1f} m at most",
    )
    yield "", conversion.vehicle.assumption


def conditions(result: Result) -> Iterator[Line]:
    """Yield the wind, the energy and the fence of a flight, each where the plan has it."""
    yield from _wind(result.solution.plan)
    yield from _energy(result.check)
    yield from _fenced(result.fence)


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
        share = partial(of_plan, bandwidth_mhz=link.bandwidth_mhz)
        yield (
            "predicted link",
            f"delivers {share(link.predicted_delivered, link.planned_delivered)}"
            f"{carried(link.predicted_mbytes)}; "
            f"R_avg {share(link.predicted_rate, link.planned_rate)}",
        )
        yield "", apart(link.rms_position_error, link.max_position_error, link.path_error)


def debriefing_lines(found: Debriefing) -> Iterator[Line]:
    """Yield what became of a plan, hop by hop: planned, predicted and flown."""
    solution, plan = found.solution, found.solution.plan
    bandwidth = plan.radio.bandwidth_mhz
    for name, flight in (("predicted", found.predicted), ("flown", found.flown)):
        late = round(flight.duration - plan.flight.duration, 1) + 0.0  # no minus before 0.0
        yield (
            name,
            f"delivers {of_plan(flight.delivered_rate, solution.delivered_rate, bandwidth)}"
            f"{carried(plan.megabytes(flight.delivered_rate))}, in {flight.duration:.1f} s "
            f"({late:+.1f} s)",
        )
        yield "", f"base station to UAV {of_plan(flight.rates.R_U, solution.rates.R_U, bandwidth)}"
        yield "", f"UAV to user {of_plan(flight.rates.R_G, solution.rates.R_G, bandwidth)}"
        yield (
            "",
            apart(flight.rms_position_error, flight.max_position_error, flight.max_path_error),
        )
    yield "height", f"at most {found.altitude_error:.1f} m from the planned one"
    if found.missing > 0:
        yield (
            "incomplete",
            f"of the plan's last {found.missing:.1f} s there is no flight: counted as if the "
            "aircraft had stayed where it was seen last",
        )


def _mission(result: Result) -> Iterator[Line]:
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
    delivers = f"delivers {of_plan(flown.delivered_rate, solution.delivered_rate, bandwidth)}"
    delivers += carried(plan.megabytes(flown.delivered_rate))
    average = of_plan(flown.rates.R_avg, solution.rates.R_avg, bandwidth)
    if plan.radio.causal:
        yield "predicted", delivers + lasting
        yield "", f"R_avg {average}"
    else:
        yield "predicted", average + lasting
        yield "", delivers
    yield "", apart(flown.rms_position_error, flown.max_position_error, flown.max_path_error)
    yield "", conversion.vehicle.assumption


def _wind(plan: Plan) -> Iterator[Line]:
    """Yield the plan's wind, if it has one."""
    wind, told = plan.site.wind, []
    if any(plan.wind):
        told.append(f"planned for {wind.speed:g} m/s from {wind.from_degrees:g} degrees")
    if wind.gust > wind.speed:
        told.append(f"gusts of {wind.gust:g} m/s")
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


def _fenced(fence: FenceSummary | None) -> Iterator[Line]:
    if fence is None:
        return
    kept = f"the plan keeps {fence.planned_clearance:.1f} m (margin {fence.margin:g} m)"
    if fence.predicted_clearance is not None:
        kept += f", the predicted flight {fence.predicted_clearance:.1f} m"
    more = f" and {fence.areas - _MOST_ZONES} more" if fence.areas > _MOST_ZONES else ""
    yield "fence", f"{', '.join(fence.zones[:_MOST_ZONES])}{more}"
    yield from (("", note) for note in fence.notes)
    yield "", f"{kept} from the edge"
