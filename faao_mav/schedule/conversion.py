"""From a trajectory to the mission whose predicted flight keeps it, in space and time."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import floor, inf
from typing import TypeAlias

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError, InputError
from faao_mav.mission.fence_area import FreeArea
from faao_mav.mission.item import Mission
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan
from faao_mav.schedule.assemble import assemble
from faao_mav.schedule.copter_scheduler import CopterScheduler
from faao_mav.schedule.initial_route import Splines, initial_route, slowest_leg, with_ramps
from faao_mav.schedule.plane_scheduler import PlaneScheduler
from faao_mav.schedule.route import Route
from faao_mav.schedule.schedule import Schedule
from faao_mav.schedule.scheduler import GOOD_COST, WORTHWHILE, Scheduler
from faao_mav.schedule.transit import check_transit
from faao_mav.schedule.waypoints import SLOWEST
from faao_mav.vehicle import Ceiling, Vehicle, vehicle_of
from faao_mav.vehicle.vehicle import candidates

# Chosen; what a change costs is not measured.
_SPLINE_SPACING = 10.0  # the least distance of spline waypoints, m
_SPLINE_TIMES = (2.0, 3.0)  # least times between spline waypoints to try, s
_BRAKING = 1.1  # the last leg of splines over v²/a: they use half of the acceleration
_PLANE_SHARE = 0.8  # of the path tolerance for the initial route of a plane, which is then split
_DECIMALS = 3  # of the positions in m: the last digits are another processor's
_FINEST_TOLERANCE = 0.5  # the path tolerance, m, that is not halved again for a fence; chosen
_GOOD = (0.0, GOOD_COST)  # the rank, m, from which nothing better is looked for

_Scheduled: TypeAlias = tuple[Schedule, Scheduler]
_Rank: TypeAlias = tuple[float, float]
"""How far a schedule gets out of the fence, m, and its `Schedule.cost`, m."""


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


def check_vehicle(plan: Plan) -> None:
    """Raise `InputError` for a vehicle that no mission can be made for, before any work is done.

    That is one with useless parameters, one of a speed that no mission commands, or a plane that
    does not fly the plan's least or greatest speed. Likewise for a fence around which there is no
    way from home and back: see `check_transit`.
    """
    check_transit(plan)
    vehicle = vehicle_of(plan)
    vehicle.legs  # noqa: B018
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
    vehicles = _vehicles(plan)
    lines = []
    for key, unit in (("max_speed", "m/s"), ("max_acceleration", "m/s^2")):
        limits = [_ceiling(vehicle, key) for vehicle in vehicles]
        most, why = max(limits)
        value = getattr(plan.vehicle, key)
        if value > most:
            lines.append(
                f"{plan.source}: vehicle.{key}: {value:g} {unit}; {vehicles[0].type.name} keeps "
                f"plans of at most {floor(10 * most) / 10:g} {unit} ({why})"
            )
    return lines


def _ceiling(vehicle: Vehicle, key: str) -> tuple[float, str]:
    """Return the greatest value of a plan's `key` that `vehicle` keeps, and what sets it."""
    kind = vehicle.type
    told = [Ceiling("max_speed", kind.fastest)] if kind.hovers else []
    own = [each for each in (*kind.ceilings(vehicle), *told) if each.key == key]
    least = min(own, key=lambda each: each.value, default=None)
    if least is None:
        return inf, ""
    name = vehicle.name_of(least.parameter) if least.parameter else "the most that it is told"
    return least.value, name


def _vehicles(plan: Plan) -> list[Vehicle]:
    """Return the vehicle of `plan` with each set of parameters that is recommended for it."""
    given = vehicle_of(plan)
    return [
        replace(given, parameters={**given.parameters, **parameters})
        for parameters in candidates(plan)
    ]


def convert(solution: Solution) -> Conversion:
    """Return the mission for `solution`, with the parameters that make it fly best.

    A route whose legs or predicted flight leave the plan's fence is made anew with half the path
    tolerance, again and again down to 0.25 m; if none keeps inside, it is the one that leaves the
    fence the least. The rest is as in `_convert`.
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
    """Return how far, m, legs and predicted flight get out of the fence; 0 inside or without."""
    paths = (schedule.route.positions, schedule.track()["predicted_w"])
    return 0.0 if area is None else max(0.0, *(-area.clearance(path) for path in paths))


def _convert(solution: Solution, plan: Plan) -> Conversion:
    """Return the mission for `solution` within the path tolerance of `plan`.

    The sets of parameters that are recommended for the vehicle are compared by the error of the
    first schedule, and refined in that order until one is good, or hardly better than the best
    before. If none is good, copters get legs of their own for where the plan speeds up and slows
    down. If that is not good either, a vehicle that flies splines may do so with the liveliest:
    everywhere, or where legs are too short for their speed.

    Raises `InputError` for unusable parameters, `InfeasibleError` for too many items.
    """
    t, w = solution.t, np.round(solution.w, _DECIMALS)
    given, sets = vehicle_of(plan), candidates(plan)
    schedulers = [_scheduler(plan, t, w, vehicle) for vehicle in _vehicles(plan)]
    straight = initial_route(t, w, plan, share=1.0 if given.type.hovers else _PLANE_SHARE)

    def rank(scheduled: _Scheduled) -> _Rank:
        """Order schedules: inside the fence first, then by cost."""
        return _outside(scheduled[0], plan.keep_in), scheduled[0].cost

    def better(best: _Scheduled, trials: Iterable[tuple[Route, Scheduler]]) -> _Scheduled:
        """Return `best`, or what is better of `trials` if all of these are flown to their end."""
        try:
            return _refined(trials, rank, best)
        except InputError:
            return best

    best = _refined(((straight, scheduler) for scheduler in schedulers), rank)
    if rank(best) > _GOOD and given.type.hovers:
        ramped = with_ramps(straight, t, w, given.legs.least)
        best = better(best, ((ramped, scheduler) for scheduler in schedulers))
    if rank(best) > _GOOD and given.type.dialect.splines:
        liveliest = schedulers[-1]
        bent = [initial_route(t, w, plan, splines=splines) for splines in _splines(liveliest)]
        new = {route.positions.tobytes(): route for route in bent if route.splines.any()}
        best = better(best, ((route, liveliest) for route in new.values()))
    schedule, scheduler = best
    return Conversion(
        mission=assemble(schedule.route, plan),
        schedule=schedule,
        vehicle=scheduler.vehicle,
        parameters=sets[schedulers.index(scheduler)],
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
        altitude=_altitude(plan),
        wind=plan.wind,
    )


def _altitude(plan: Plan) -> float:
    """Return the height of the flight above sea level, m."""
    return plan.origin.elevation + plan.flight.altitude


def _true_over_commanded(plan: Plan) -> float:
    """Return true over commanded airspeed at the height of the flight."""
    vehicle = vehicle_of(plan)
    return vehicle.type.true_over_commanded(vehicle, _altitude(plan))


def _refined(
    trials: Iterable[tuple[Route, Scheduler]],
    rank: Callable[[_Scheduled], _Rank],
    best: _Scheduled | None = None,
) -> _Scheduled:
    """Return the best of `best` and the schedules of the trials, refined.

    They are refined one after the other, the most promising first, up to one that is good, or
    hardly better than the best before it.
    """
    firsts = [(scheduler.first(route), scheduler) for route, scheduler in trials]
    for first, scheduler in sorted(firsts, key=lambda each: each[0].error):
        tried = scheduler.refined(first), scheduler
        if best is not None:
            outside, cost = rank(best)
            if rank(tried) > (outside, WORTHWHILE * cost):
                return min(best, tried, key=rank)
        best = tried
        if rank(best) <= _GOOD:
            break
    assert best is not None, "no trials"
    return best


def _splines(scheduler: Scheduler) -> Iterator[Splines]:
    """Yield what may be splines on a flight at the greatest speed: all legs, or some."""
    vehicle, speed = scheduler.vehicle, scheduler.max_speed
    braking = _BRAKING * speed**2 / vehicle.value("acceleration")
    for seconds in _SPLINE_TIMES:
        spacing = max(_SPLINE_SPACING, seconds * speed)
        yield Splines(spacing, braking)
        yield Splines(spacing, braking, vehicle.legs)
