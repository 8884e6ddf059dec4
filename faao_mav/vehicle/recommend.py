"""Which autopilot parameters a mission is timed for.

An autopilot whose ramps take longer than the plan's falls behind at every one; one that turns
corners at a crawl does so in every curve. Few parameters decide that: the limits of acceleration
and jerk, and for PX4 how far it may fall behind before it slows down and how well it has to meet
a waypoint's altitude.
"""

from collections.abc import Mapping

from faao_mav.plan import Plan
from faao_mav.vehicle.parameter import Parameter
from faao_mav.vehicle.vehicle import vehicle_type

_GENTLE = (1.35, 2.0)
"""The gentle accelerations to try, as multiples of a_max: 1.35 makes up for the time that
a jerk-limited ramp loses (measured: 1.3 to 1.4 on near-straight plans); 2 is chosen."""


def candidates(plan: Plan) -> tuple[Mapping[str, float], ...]:
    """Return the sets of parameters to try for `plan`, the gentlest first.

    One empty set if the plan keeps its vehicle's own, or if they are tuned on each vehicle, as an
    aeroplane's are.
    """
    given = plan.vehicle
    if plan.mission.parameters == "keep":
        return ({},)
    recommended = vehicle_type(given.autopilot, given.type).recommended
    return tuple(recommended(given.max_speed, given.max_acceleration))


def accelerations_to_try(
    parameter: Parameter, max_acceleration: float, curved: float
) -> list[float]:
    """Return values of `parameter` to try for a plan's a_max, m/s², the lowest first.

    They are the gentle ones and one for `curved` paths, all within the documented range.
    """
    low, high = parameter.documented
    wanted = (*(share * max_acceleration for share in _GENTLE), curved)
    return sorted({round(min(max(each, low), high), 2) for each in wanted})
