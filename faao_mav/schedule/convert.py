"""From a trajectory to the mission whose predicted flight keeps it, in space and time."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from faao_mav.errors import InputError
from faao_mav.mission.item import Mission
from faao_mav.schedule.assemble import assemble
from faao_mav.schedule.outline import Splines, plan_route
from faao_mav.schedule.plane_scheduler import PlaneScheduler
from faao_mav.schedule.route import Route
from faao_mav.schedule.run_in import with_run_in
from faao_mav.schedule.schedule import Schedule
from faao_mav.schedule.scheduler import Scheduler
from faao_mav.vehicle import Vehicle, copter_model, flight_model, vehicle_of
from faao_mav.vehicle.ardupilot.plane.model import ArduPlane
from faao_mav.vehicle.legs import ArduCopterLegs, Legs, legs_of
from faao_mav.vehicle.recommend import candidates

if TYPE_CHECKING:
    from faao_mav.optimizer.solution import Solution
    from faao_mav.plan import Plan

_SPLINE_SPACING, _SPLINE_TIMES = 10.0, (2.0, 3.0)
"""Metres, and seconds of flight, between spline waypoints at least."""

_BRAKING = 1.1
"""Of v²/a: splines use half of the acceleration."""

_PLANE_SHARE = 0.4
"""Of the path tolerance: what a plane's waypoints may use up, for it strays from them."""

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


def check_vehicle(plan: "Plan") -> None:
    """Raise `InputError` for a vehicle that no mission can be made for, before any work is done.

    That is one with useless parameters, or a plane that does not fly the plan's least or greatest
    speed.
    """
    vehicle = vehicle_of(plan)
    legs_of(vehicle)
    model = flight_model(vehicle)
    if not isinstance(model, ArduPlane):
        return
    least, most = model.min_speed, model.max_speed
    flown = f"the plane flies {least:g} to {most:g} m/s (AIRSPEED_MIN, AIRSPEED_MAX"
    flown += "; vehicle.parameters may say otherwise)"
    for key, speed in (
        ("min_speed", plan.vehicle.min_speed),
        ("max_speed", plan.vehicle.max_speed),
    ):
        if not least <= speed <= most:
            raise InputError(f"{plan.source}: vehicle.{key}: {speed:g} m/s; {flown}")


def convert(solution: "Solution") -> Conversion:
    """Return the mission for `solution`, with the parameters that make it fly best.

    The sets of parameters that `recommend` proposes are compared by the error of the first legs,
    and refined in that order until one is good. If none is, ArduPilot may fly splines with the
    liveliest: everywhere, or where legs are too short for their speed.
    Raises `InputError` for unusable parameters, `InfeasibleError` for too many items.
    """
    plan, t, w = solution.plan, solution.t, solution.w
    top = min(plan.vehicle.max_speed, vehicle_of(plan).type.fastest)
    trials = [_Trial.of(solution, parameters, top) for parameters in candidates(plan)]
    share = _PLANE_SHARE if plan.vehicle.type == "plane" else 1.0
    straight = plan_route(t, w, plan, share=share)
    firsts = [trial.first(straight) for trial in trials]
    best = min(_refined(firsts), key=lambda each: each[0].cost)
    liveliest = trials[-1]
    if best[0].cost > _GOOD and isinstance(liveliest.legs, ArduCopterLegs):
        bent = [plan_route(t, w, plan, splines=s) for s in _splines(liveliest.legs, top)]
        new = {route.positions.tobytes(): route for route in bent if route.splines.any()}
        firsts = [liveliest.first(route) for route in new.values()]
        best = min([best, *_refined(firsts)], key=lambda each: each[0].cost)
    schedule, trial = best
    return Conversion(assemble(schedule.route, plan), schedule, trial.vehicle, trial.parameters)


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """A vehicle with one set of parameters, and what schedules its flights."""

    parameters: Mapping[str, float]
    vehicle: Vehicle
    legs: Legs
    scheduler: Scheduler

    @classmethod
    def of(cls, solution: "Solution", parameters: Mapping[str, float], top: float) -> "_Trial":
        plan = solution.plan
        given = vehicle_of(plan)
        vehicle = replace(given, parameters={**given.parameters, **parameters})
        legs = legs_of(vehicle)
        return cls(parameters, vehicle, legs, _scheduler(solution, vehicle, legs, top))

    def first(self, route: Route) -> tuple[Schedule, "_Trial"]:
        """Return `route` with the speeds and holds that fit best, not yet refined."""
        planner = self.scheduler
        begun = with_run_in(route, planner.t, planner.w, self.legs, planner.max_speed)
        return planner.first(begun), self


def _scheduler(solution: "Solution", vehicle: Vehicle, legs: Legs, top: float) -> Scheduler:
    plan, t, w = solution.plan, solution.t, solution.w
    near = plan.mission.path_tolerance
    if vehicle.kind == "plane":
        plane = ArduPlane.from_vehicle(vehicle)
        least, most = plane.min_speed, min(plan.vehicle.max_speed, plane.max_speed)
        slowest = max(plan.vehicle.min_speed, least)
        return PlaneScheduler(t, w, plane, legs, most, near, slowest, whole_seconds=False)
    model, whole = copter_model(vehicle, plan.origin.latitude), vehicle.type.whole_second_holds
    return Scheduler(t, w, model, legs, top, near, whole_seconds=whole)


def _refined(firsts: list[tuple[Schedule, _Trial]]) -> list[tuple[Schedule, _Trial]]:
    """Return first schedules refined, the closest to the plan first, up to one that is good."""
    found: list[tuple[Schedule, _Trial]] = []
    for first, trial in sorted(firsts, key=lambda each: each[0].error):
        found.append((trial.scheduler.refined(first), trial))
        if found[-1][0].cost <= _GOOD:
            break
    return found


def _splines(straight: ArduCopterLegs, speed: float) -> Iterator[Splines]:
    """Yield what may be splines on a flight at `speed` m/s: all, or some."""
    braking = _BRAKING * speed**2 / straight.acceleration
    for seconds in _SPLINE_TIMES:
        spacing = max(_SPLINE_SPACING, seconds * speed)
        yield Splines(spacing, braking)
        yield Splines(spacing, braking, straight)


def to_mission(solution: "Solution") -> Mission:
    """Return the mission for `solution`: that of `convert`."""
    return convert(solution).mission
