"""Whether a copter can lean as far as a plan asks: against the drag, and to change its velocity."""

import math

import numpy as np

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.body import CopterBody
from faao_mav.autopilot.vehicle_type import lean_acceleration
from faao_mav.optimizer.solution import Solution
from faao_mav.power import GRAVITY
from faao_mav.vector import lengths

_LEAST = 0.1
"""m/s that are missing from which on it is told: rounding is less. Chosen."""


def beyond_lean(solution: Solution, vehicle: Vehicle) -> str | None:
    """Return in words how `solution` asks `vehicle` to lean further than it may; None: not at all.

    At the velocity v through the air and the acceleration a it leans by

        tan(lean) = |a + (c_1 + c_2 |v|) v| / g,

    with the drag of its body. Without a model with drag nothing is known to lack.
    """
    body = vehicle.airframe
    if not isinstance(body, CopterBody) or not vehicle.type.models_wind:
        return None
    v = solution.v - solution.plan.wind
    drag = (body.linear_drag + body.quadratic_drag * lengths(v)[:, None]) * v
    push = np.maximum(*(lengths(solution.a[:-1] + each) for each in (drag[:-1], drag[1:])))
    allowed, slot = vehicle.value("lean_angle"), float(solution.t[1])
    missing = np.maximum(push - lean_acceleration(allowed), 0.0)
    if slot * missing.sum() < _LEAST:
        return None
    return (
        f"the plan asks for a lean of up to {math.degrees(math.atan(push.max() / GRAVITY)):.0f} "
        f"degrees against the drag of vehicle.body, and for {slot * (missing > 0).sum():.1f} s of "
        f"more than the {math.degrees(allowed):.0f} that its parameters allow: it falls behind"
    )
