"""Plans beyond what their vehicle flies: what is refused, and what would be accepted."""

import re
from typing import Any

import pytest
from relay_flights import plan_with

from faao_mav.errors import InputError
from faao_mav.schedule.conversion import beyond_vehicle, check_vehicle

PX4 = {"autopilot": "px4"}
TILT = {"parameters": {"MPC_TILTMAX_AIR": 20}}
PLANE = {"type": "plane", "min_speed": 12, "max_speed": 16, "parameters": {"ROLL_LIMIT_DEG": 30}}


@pytest.mark.parametrize(
    ("recommend", "vehicle", "most", "why"),
    [
        (True, {}, (20, 5), ("the most that it is told", "WP_ACC")),
        (False, {}, (20, 2.5), ("the most that it is told", "WP_ACC, its default")),
        (
            False,
            {"parameters": {"WPNAV_ACCEL": 700}},
            (20, 5.6),
            ("", "ATC_ANGLE_MAX, its default"),
        ),
        (True, PX4, (20, 9.8), ("", "MPC_TILTMAX_AIR, its default")),
        (False, PX4, (12, 3), ("MPC_XY_VEL_MAX, its default", "MPC_ACC_HOR, its default")),
        (True, PX4 | TILT, (20, 3.5), ("", "MPC_TILTMAX_AIR")),
        (True, PLANE, (None, 5.6), ("", "ROLL_LIMIT_DEG")),
    ],
)
def test_what_is_accepted_follows_the_parameters(
    recommend: bool, vehicle: dict[str, Any], most: tuple[float | None, float], why: tuple[str, str]
) -> None:
    plan = plan_with(recommend=recommend, **vehicle)

    def limited(speed: float, acceleration: float) -> list[str]:
        limits = {"vehicle.max_speed": speed, "vehicle.max_acceleration": acceleration}
        return beyond_vehicle(plan.changed(limits))

    told = [(each, reason) for each, reason in zip(most, why, strict=True) if each is not None]
    lines = limited(25, 50)
    assert [re.findall(r"at most (\S+) m/s", line) for line in lines] == [
        [f"{each:g}"] for each, _ in told
    ]
    assert all(f"({reason}" in line for line, (_, reason) in zip(lines, told, strict=True))
    assert limited(most[0] or 16, most[1]) == []


def test_what_no_mission_is_made_for_is_refused_before_the_work() -> None:
    (line,) = beyond_vehicle(plan_with(recommend=True, max_speed=25))
    assert line == (
        "plan: vehicle.max_speed: 25 m/s; ArduCopter keeps plans of at most 20 m/s "
        "(the most that it is told)"
    )
    slow = plan_with(recommend=True).changed({"vehicle.max_speed": 0.05, "flight.end": [0, 350]})
    with pytest.raises(InputError, match=r"vehicle\.max_speed: 0\.05 m/s; missions command 0\.1"):
        check_vehicle(slow)
    with pytest.raises(InputError, match=r"vehicle\.parameters.*WPNAV_JERK: 0"):
        check_vehicle(plan_with(parameters={"WPNAV_JERK": 0.0}))
