"""Whether a copter can lean as far as a plan asks: against the drag, and to change its velocity."""

import math
from dataclasses import dataclass

import numpy as np

from faao_mav.autopilot import Vehicle
from faao_mav.autopilot.body import CopterBody
from faao_mav.autopilot.vehicle_type import lean_acceleration
from faao_mav.optimizer.solution import Solution
from faao_mav.power import GRAVITY

_LEAST = 0.1
"""m/s that are missing from which on it is told: rounding is less. Chosen."""


@dataclass(frozen=True, slots=True)
class Lean:
    """A plan asks for a lean of up to `needed`, for `seconds` s more than `allowed`, rad."""

    needed: float
    allowed: float
    seconds: float

    def __str__(self) -> str:
        """Return it in words."""
        needed, allowed = (f"{math.degrees(each):.0f}" for each in (self.needed, self.allowed))
        return (
            f"the plan asks for a lean of up to {needed} degrees against the drag of vehicle.body, "
            f"and for {self.seconds:.1f} s of more than the {allowed} that its parameters allow: "
            "there it falls behind"
        )


def beyond_lean(solution: Solution, vehicle: Vehicle) -> Lean | None:
    """Return how `solution` asks `vehicle` to lean further than it may; None: it does not.

    At the velocity v through the air and the acceleration a it leans by

        tan(lean) = |a + (c_1 + c_2 |v|) v| / g,

    with the drag of its body. Others are not known to lack any.
    """
    body = vehicle.airframe
    if not vehicle.type.models_wind or not isinstance(body, CopterBody):
        return None
    allowed = vehicle.value("lean_angle")
    pushes = []
    for v in (solution.v[:-1] - solution.plan.wind, solution.v[1:] - solution.plan.wind):
        speed = np.linalg.norm(v, axis=1, keepdims=True)
        drag = (body.linear_drag + body.quadratic_drag * speed) * v
        pushes.append(np.linalg.norm(solution.a[:-1] + drag, axis=1))
    push, slot = np.maximum(*pushes), float(solution.t[1])
    missing = np.maximum(push - lean_acceleration(allowed), 0.0)
    if slot * missing.sum() < _LEAST:
        return None
    needed = math.atan(float(push.max()) / GRAVITY)
    return Lean(needed, allowed, slot * int((missing > 0).sum()))
