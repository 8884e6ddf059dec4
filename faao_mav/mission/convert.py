"""From a trajectory to the mission whose predicted flight keeps it, in space and time."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from faao_mav.mission import flight
from faao_mav.mission.assemble import assemble
from faao_mav.mission.autopilot import legs_of
from faao_mav.mission.item import Mission
from faao_mav.mission.outline import plan_route
from faao_mav.mission.recommend import candidates
from faao_mav.mission.run_in import with_run_in
from faao_mav.mission.schedule import Schedule, schedule
from faao_mav.mission.vehicle import Vehicle, vehicle_of

if TYPE_CHECKING:
    from faao_mav.faao.solution import Solution

_PER_WAYPOINT = 0.02
"""Metres of rms error that one waypoint less is worth."""

_ASTRAY = 10.0
"""Metres of rms error that one metre beyond the path tolerance weighs."""


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

    Each set of parameters that `recommend` proposes is given a route and a schedule of its own;
    the least rms error at equal times wins, with some regard to the number of waypoints.
    Raises `InputError` for unusable parameters, `InfeasibleError` for too many items.
    """
    plan, tried = solution.plan, []
    limit = plan.mission.path_tolerance
    for parameters in candidates(plan):
        given = vehicle_of(plan)
        vehicle = Vehicle(
            given.autopilot, given.kind, {**given.parameters, **parameters}, given.source
        )
        legs, speed = legs_of(vehicle), plan.vehicle.max_speed
        route = plan_route(solution.t, solution.w, plan)
        route = with_run_in(route, solution.t, solution.w, legs, speed)
        timed = schedule(route, solution.t, solution.w, flight.flight_model(vehicle), legs, speed)
        found = timed.deviation
        cost = found.rms + _PER_WAYPOINT * len(timed.route.positions)
        tried.append(
            (cost + _ASTRAY * max(0.0, found.path - limit), len(tried), timed, vehicle, parameters)
        )
    _, _, timed, vehicle, parameters = min(tried)
    return Conversion(assemble(timed.route, plan), timed, vehicle, parameters)


def to_mission(solution: "Solution") -> Mission:
    """Return the mission for `solution`: that of `convert`."""
    return convert(solution).mission
