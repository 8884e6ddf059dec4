"""Plans beyond what their vehicle flies: what is refused, and what would be accepted."""

import re
from typing import Any

import pytest
from conftest import MakePlan
from relay_flights import plan_with

from faao_mav.errors import InputError
from faao_mav.plan import Plan
from faao_mav.schedule.conversion import beyond_vehicle, check_vehicle


def limited(small_plan: MakePlan, speed: float, acceleration: float, **vehicle: Any) -> Plan:
    """Return the small plan with these limits; `keep` its vehicle's parameters."""
    keep = vehicle.pop("keep", False)
    ends = {"flight.start_velocity": "free", "flight.end_velocity": "free"}
    parameters = "keep" if keep else "recommend"
    plan = small_plan(ends | {"flight.duration": 600, "mission.parameters": parameters})
    vehicle |= {"max_speed": speed, "max_acceleration": acceleration}
    return plan.changed({f"vehicle.{key}": value for key, value in vehicle.items()})


@pytest.mark.parametrize(
    ("vehicle", "most"),
    [
        ({}, (20, 5)),  # the most that it is told
        ({"keep": True}, (20, 2.5)),
        ({"keep": True, "parameters": {"WPNAV_ACCEL": 700}}, (20, 5.6)),  # g tan 30 degrees
        ({"body": {"linear_drag": 5}}, (20, 5)),  # an airframe refuses nothing
        ({"autopilot": "px4"}, (20, 9.8)),
        ({"autopilot": "px4", "keep": True}, (12, 3)),
        ({"autopilot": "px4", "parameters": {"MPC_TILTMAX_AIR": 20}}, (20, 3.5)),
        ({"autopilot": "px4", "keep": True, "parameters": {"MPC_XY_VEL_MAX": 9}}, (9, 3)),
    ],
)
def test_what_is_accepted_follows_the_parameters(
    small_plan: MakePlan, vehicle: dict[str, Any], most: tuple[float, float]
) -> None:
    lines = beyond_vehicle(limited(small_plan, 100, 50, **vehicle))
    assert [re.findall(r"at most (\S+) m/s", line) for line in lines] == [
        [f"{each:g}"] for each in most
    ]
    assert beyond_vehicle(limited(small_plan, *most, **vehicle)) == []


def test_the_line_names_what_sets_the_limit(small_plan: MakePlan) -> None:
    (line,) = beyond_vehicle(limited(small_plan, 25, 1))
    assert line == (
        "plan: vehicle.max_speed: 25 m/s; ArduCopter keeps plans of at most 20 m/s "
        "(the most that it is told)"
    )
    (line,) = beyond_vehicle(limited(small_plan, 13, 1, autopilot="px4", keep=True))
    assert line.endswith("PX4 keeps plans of at most 12 m/s (MPC_XY_VEL_MAX, its default)")
    plane = {"type": "plane", "min_speed": 12, "parameters": {"ROLL_LIMIT_DEG": 30}}
    (line,) = beyond_vehicle(limited(small_plan, 16, 7, **plane))
    assert line.endswith("ArduPlane keeps plans of at most 5.6 m/s^2 (ROLL_LIMIT_DEG)")
    slow = plan_with(recommend=True).changed({"vehicle.max_speed": 0.05, "flight.end": [0, 350]})
    with pytest.raises(InputError, match=r"vehicle\.max_speed: 0\.05 m/s; missions command 0\.1"):
        check_vehicle(slow)
    with pytest.raises(InputError, match=r"vehicle\.parameters.*WPNAV_JERK: 0"):
        check_vehicle(plan_with(parameters={"WPNAV_JERK": 0.0}))
