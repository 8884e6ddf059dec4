"""From a trajectory to the mission whose predicted flight keeps it, in space and time."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import floor, inf

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot import Vehicle
from faao_mav.errors import InfeasibleError, InputError, counted
from faao_mav.mission.fence_area import FreeArea
from faao_mav.mission.item import Mission
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan
from faao_mav.schedule.assemble import ROUNDING, assemble, check_transit
from faao_mav.schedule.prediction import Schedule
from faao_mav.schedule.route import initial_route, slowest_leg, with_run_in
from faao_mav.schedule.scheduler import ALLOWED_ERROR, CopterScheduler, PlaneScheduler, Scheduler
from faao_mav.schedule.waypoints import DIGITS, SLOWEST

_FINEST_TOLERANCE = 0.5  # the path tolerance, m, that is not halved again for a fence; chosen


@dataclass(frozen=True, slots=True, eq=False)
class Conversion:
    """A mission, with all that has to be known to fly it.

    `parameters` are those that the autopilot has to be given before the flight, by its own names
    and in its own units: the mission is timed for them, and late without. There are none if the
    plan keeps the vehicle's own. `vehicle` has them already. `schedule` holds the predicted flight.

    >>> from faao_mav import optimize, read_plan
    >>> conversion = convert(optimize(read_plan("missions/copter_relay.yaml")))
    >>> conversion.mission.items[0].command.name, conversion.parameters["WPNAV_SPEED"]
    ('NAV_TAKEOFF', 800)
    >>> conversion.schedule.deviation.rms < 1.5  # metres
    True
    """

    mission: Mission
    schedule: Schedule
    vehicle: Vehicle
    parameters: Mapping[str, float]

    def __repr__(self) -> str:
        """Say how large the mission is, in a line."""
        return f"<Conversion: {self.mission!r}, {counted(len(self.parameters), 'parameter')}>"


def check_vehicle(plan: Plan) -> None:
    """Raise `InputError` for a vehicle that no mission can be made for, before any work is done.

    That is one with useless parameters, one of a speed that no mission commands, or a plane that
    does not fly the plan's least or greatest speed. Likewise for a fence around which there is no
    way from home and back: see `check_transit`.
    """
    check_transit(plan)
    vehicle = plan.aircraft
    vehicle.flight_model()
    if plan.vehicle.max_speed < SLOWEST:
        raise InputError(
            f"{plan.source}: vehicle.max_speed: {plan.vehicle.max_speed:g} m/s; missions command "
            f"{SLOWEST:g} m/s and more"
        )
    if vehicle.type.hovers:
        return
    ratio = _true_over_commanded(plan)
    least, most = (ratio * vehicle.value(key) for key in ("min_speed", "max_speed"))
    names = f"{vehicle.name_of('min_speed')}; {vehicle.name_of('max_speed')}"
    for key in ("min_speed", "max_speed"):
        speed = getattr(plan.vehicle, key)
        if not least <= speed <= most:
            raise InputError(
                f"{plan.source}: vehicle.{key}: {speed:g} m/s; the plane flies {least:.4g} to "
                f"{most:.4g} m/s ({names}; vehicle.parameters may say otherwise)"
            )


def beyond_vehicle(plan: Plan) -> list[str]:
    """Return a line for each limit of `plan` that is beyond its vehicle, with what it may be.

    The vehicle has the parameters that are recommended for it, or its own if the plan keeps them.
    """
    vehicles = [_with(plan.aircraft, each) for each in plan.candidates]
    lines = []
    for key, unit in (("max_speed", "m/s"), ("max_acceleration", "m/s^2")):
        limits = [vehicle.ceiling(key) for vehicle in vehicles]
        most, why = max(limits)
        value = getattr(plan.vehicle, key)
        if value > most:
            lines.append(
                f"{plan.source}: vehicle.{key}: {value:g} {unit}; {vehicles[0].type.name} keeps "
                f"plans of at most {floor(10 * most) / 10:g} {unit} ({why})"
            )
    return lines


def _with(given: Vehicle, parameters: Mapping[str, float]) -> Vehicle:
    return replace(given, parameters={**given.parameters, **parameters})


def convert(solution: Solution) -> Conversion:
    """Return the mission for `solution`, with the parameters that make it fly best.

    A route whose legs or predicted flight leave the plan's fence is made anew with half the path
    tolerance, again and again down to 0.25 m; if none keeps inside, it is the one that leaves the
    fence the least. The rest is as in `_convert`.

    >>> from faao_mav import optimize, read_plan
    >>> brief = {"radio.fading": "none", "flight.duration": 30, "flight.end": [0, 300]}
    >>> brief["mission.parameters"] = "keep"
    >>> found = convert(optimize(read_plan("missions/copter_relay.yaml").changed(brief)))
    >>> found.mission.items[-1].command.name, found.parameters
    ('NAV_RETURN_TO_LAUNCH', {})
    """
    plan, area = solution.plan, solution.plan.keep_in
    best = _convert(solution, plan)
    outside, tolerance = _outside(best.schedule, area), plan.mission.path_tolerance
    while outside > 0 and tolerance > _FINEST_TOLERANCE:
        tolerance /= 2
        finer = plan.changed({"mission.path_tolerance": tolerance})
        try:
            tried = _convert(solution, finer)
        except InfeasibleError:  # too many items
            break
        if _outside(tried.schedule, area) < outside:
            best, outside = tried, _outside(tried.schedule, area)
    return best


def _outside(schedule: Schedule, area: FreeArea | None) -> float:
    """Return how far, m, legs and predicted flight get out of the fence; 0 inside or without.

    A leg that is not inside by `ROUNDING` may be outside as sent.
    """
    if area is None:
        return 0.0
    legs = area.clearance(schedule.route.positions) - ROUNDING
    return max(0.0, -legs, -area.clearance(schedule.track()["predicted_w"]))


def _convert(solution: Solution, plan: Plan) -> Conversion:
    """Return the mission for `solution` within the path tolerance of `plan`.

    The sets of parameters that are recommended for the vehicle are refined in the order of their
    first schedules' errors until one is good; the best is taken.

    Raises `InputError` for unusable parameters, `InfeasibleError` for too many items.
    """
    t, w = solution.t, np.round(solution.w, DIGITS)
    route = initial_route(t, w, plan)
    sets = plan.candidates
    schedulers = [_scheduler(plan, t, w, _with(plan.aircraft, each)) for each in sets]
    routes = [with_run_in(route, t, w, each.model, each.max_speed) for each in schedulers]
    firsts = [each.first(begun) for each, begun in zip(schedulers, routes, strict=True)]
    order = sorted(range(len(firsts)), key=lambda k: firsts[k].error)
    chosen, best, rank = order[0], firsts[order[0]], (inf, inf)
    for k in order:
        tried = schedulers[k].refined(firsts[k])
        new = _outside(tried, plan.keep_in), tried.cost  # inside the fence first
        if new < rank:
            chosen, best, rank = k, tried, new
        if rank <= (0.0, 1.2 * ALLOWED_ERROR):  # others take long and gain little
            break
    return Conversion(
        mission=assemble(best.route, plan),
        schedule=best,
        vehicle=schedulers[chosen].vehicle,
        parameters=sets[chosen],
    )


def _scheduler(plan: Plan, t: Real, w: Real, vehicle: Vehicle) -> Scheduler:
    """Return what schedules the flights of `vehicle`, which may have recommended parameters."""
    limits = plan.vehicle
    if vehicle.type.hovers:
        scheduler: type[Scheduler] = CopterScheduler
        least, most = slowest_leg(plan), vehicle.type.fastest
        fastest = limits.max_speed
    else:
        scheduler, ratio = PlaneScheduler, _true_over_commanded(plan)
        least = max(limits.min_speed / ratio, vehicle.value("min_speed"))
        most, fastest = vehicle.value("max_speed"), limits.max_speed / ratio
    return scheduler(
        t=t,
        w=w,
        vehicle=vehicle,
        model=vehicle.flight_model(plan.origin.latitude),
        min_speed=least,
        max_speed=min(fastest, most),
        tolerance=plan.mission.path_tolerance,
        altitude=plan.origin.elevation + plan.flight.altitude,
        wind=plan.wind,
    )


def _true_over_commanded(plan: Plan) -> float:
    altitude = plan.origin.elevation + plan.flight.altitude
    return plan.aircraft.flight_model().true_over_commanded(altitude)
