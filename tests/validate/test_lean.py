"""What a plan asks of a copter's lean: told where its parameters do not allow it."""

from dataclasses import replace

import numpy as np
from conftest import FLYABLE, edited

from faao_mav import optimize, parse_plan
from faao_mav.validate.speeds import beyond_lean


def test_drag_and_acceleration_add_up() -> None:
    solution = optimize(parse_plan(edited(FLYABLE, {})))
    vehicle = solution.plan.aircraft
    v, a = np.zeros_like(solution.v), np.zeros_like(solution.a)
    v[:], a[:2] = (10.0, 0.0), (2.5, 0.0)  # drag of 5.4 m/s², and g tan 30 degrees is 5.66
    asked = replace(solution, v=v, a=a)
    lean = beyond_lean(asked, vehicle)
    assert lean is not None
    assert (
        f"up to 39 degrees against the drag of vehicle.body, and for {2 * solution.t[1]:.1f} s"
        in lean
    )
    assert beyond_lean(asked, replace(vehicle, parameters={"ANGLE_MAX": 4500})) is None
    assert beyond_lean(replace(asked, a=-a), vehicle) is None  # drag slows it down
