"""From a trajectory to the mission whose predicted flight keeps it, in space and time."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from faao_mav.mission.assemble import assemble
from faao_mav.mission.autopilot import legs_of
from faao_mav.mission.flight import copter_model
from faao_mav.mission.item import Mission
from faao_mav.mission.outline import plan_route
from faao_mav.mission.recommend import FASTEST, candidates
from faao_mav.mission.run_in import with_run_in
from faao_mav.mission.schedule import Schedule, Scheduler
from faao_mav.mission.vehicle import Vehicle, vehicle_of

if TYPE_CHECKING:
    from faao_mav.faao.solution import Solution

_SPLINE_SPACING, _SPLINE_TIME = 15.0, 3.0
"""Metres, and seconds of flight, between spline waypoints at least."""

_ASTRAY = 5.0
"""Metres of rms error that one metre beyond the path tolerance weighs."""

_GOOD = 1.5
"""Metres of rms error at equal times that no better parameters are sought for."""


@dataclass(frozen=True, slots=True, eq=False)
class Conversion:
    """A mission, the schedule it flies by, and the vehicle it was timed for.

    `parameters` are those that the vehicle has to be given first, none for `keep`.
    """

    mission: Mission
    schedule: Schedule
    vehicle: Vehicle
    parameters: Mapping[str, float]


def convert(solution: "Solution") -> Conversion:
    """Return the mission for `solution`, with the parameters that make it fly best.

    The sets of parameters that `recommend` proposes are compared by the rms error at equal times
    on the first legs, and refined in that order until one is good.
    Raises `InputError` for unusable parameters, `InfeasibleError` for too many items.
    """
    plan, t, w = solution.plan, solution.t, solution.w
    top = min(plan.vehicle.max_speed, FASTEST)
    given, outlines = vehicle_of(plan), [plan_route(t, w, plan)]
    if plan.mission.parameters == "keep" and given.autopilot == "ardupilot":
        spacing = max(_SPLINE_SPACING, _SPLINE_TIME * top)
        outlines.append(plan_route(t, w, plan, spline_spacing=spacing))
    tried = []
    for parameters in candidates(plan):
        vehicle = replace(given, parameters={**given.parameters, **parameters})
        legs = legs_of(vehicle)
        scheduler = Scheduler(t, w, copter_model(vehicle, plan.origin.latitude), legs, top)
        for route in outlines:
            first = scheduler.first(with_run_in(route, t, w, legs, top))
            tried.append((first, scheduler, vehicle, parameters))
    tried.sort(key=lambda trial: trial[0].rms)
    best: Conversion | None = None
    cost: float | None = None
    limit = plan.mission.path_tolerance
    for first, scheduler, vehicle, parameters in tried:
        schedule = scheduler.refined(first)
        schedule_cost = _cost(schedule, limit)
        if cost is None or schedule_cost < cost:
            cost = schedule_cost
            best = Conversion(assemble(schedule.route, plan), schedule, vehicle, parameters)
        if cost <= _GOOD:
            break
    assert best is not None
    return best


def _cost(schedule: Schedule, limit: float) -> float:
    """Return the rms error, m, with what the path error exceeds `limit` by, heavily."""
    found = schedule.deviation
    return found.rms + _ASTRAY * max(0.0, found.path - limit)


def to_mission(solution: "Solution") -> Mission:
    """Return the mission for `solution`: that of `convert`."""
    return convert(solution).mission
