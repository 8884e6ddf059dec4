"""From a trajectory to the mission whose predicted flight keeps it, in space and time."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from faao_mav.mission.assemble import assemble
from faao_mav.mission.autopilot import Legs, legs_of
from faao_mav.mission.flight import copter_model
from faao_mav.mission.item import Mission
from faao_mav.mission.outline import Splines, plan_route
from faao_mav.mission.recommend import FASTEST, candidates
from faao_mav.mission.run_in import with_run_in
from faao_mav.mission.schedule import Schedule, Scheduler
from faao_mav.mission.vehicle import Vehicle, vehicle_of

if TYPE_CHECKING:
    from faao_mav.faao.solution import Solution

_SPLINE_SPACING, _SPLINE_TIMES = 10.0, (2.0, 3.0)
"""Metres, and seconds of flight, between spline waypoints at least."""

_BRAKING = 1.1
"""Of v²/a: splines use half of the acceleration."""

_GOOD = 1.5
"""Metres of error that no better parameters are sought for."""


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

    The sets of parameters that `recommend` proposes are compared by the error of the first legs,
    and refined in that order until one is good. ArduPilot with its own parameters may also fly
    splines, everywhere or where legs are too short for their speed.
    Raises `InputError` for unusable parameters, `InfeasibleError` for too many items.
    """
    plan, t, w = solution.plan, solution.t, solution.w
    top = min(plan.vehicle.max_speed, FASTEST)
    given = vehicle_of(plan)
    outlines = [plan_route(t, w, plan)]
    if plan.mission.parameters == "keep" and given.autopilot == "ardupilot":
        outlines += [plan_route(t, w, plan, splines=s) for s in _splines(legs_of(given), top)]
    tried = []
    for parameters in candidates(plan):
        vehicle = replace(given, parameters={**given.parameters, **parameters})
        legs = legs_of(vehicle)
        scheduler = Scheduler(
            t,
            w,
            copter_model(vehicle, plan.origin.latitude),
            legs,
            top,
            plan.mission.path_tolerance,
        )
        for route in outlines:
            first = scheduler.first(with_run_in(route, t, w, legs, top))
            tried.append((first, scheduler, vehicle, parameters))
    tried.sort(key=lambda trial: trial[0].error)
    best: Conversion | None = None
    for first, scheduler, vehicle, parameters in tried:
        schedule = scheduler.refined(first)
        if best is None or schedule.cost < best.schedule.cost:
            best = Conversion(assemble(schedule.route, plan), schedule, vehicle, parameters)
        if best.schedule.cost <= _GOOD:
            break
    assert best is not None
    return best


def _splines(straight: Legs, speed: float) -> Iterator[Splines]:
    """Yield what may be splines on a flight at `speed` m/s: all, or some."""
    braking = _BRAKING * speed**2 / straight.acceleration
    for seconds in _SPLINE_TIMES:
        spacing = max(_SPLINE_SPACING, seconds * speed)
        yield Splines(spacing, braking)
        yield Splines(spacing, braking, straight)


def to_mission(solution: "Solution") -> Mission:
    """Return the mission for `solution`: that of `convert`."""
    return convert(solution).mission
