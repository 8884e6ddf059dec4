"""How long a leg has to be."""

import numpy as np
import pytest
from relay_flights import plan_with

from faao_mav.autopilot import LegLimits
from faao_mav.autopilot.ardupilot.copter import ArduCopterLegs
from faao_mav.autopilot.px4 import Px4Legs
from faao_mav.errors import InputError


def test_measured_lengths_of_arducopter_legs() -> None:
    # Measured at 8 m/s: 49 m with default parameters, 22 m with ACCEL 400 and JERK 10.
    assert ArduCopterLegs().shortest_leg(np.array(8.0)) == pytest.approx(49, abs=1)
    assert ArduCopterLegs(acceleration=4.0, jerk=10.0).shortest_leg(np.array(8.0)) == pytest.approx(
        22, abs=1
    )


@pytest.mark.parametrize(
    "legs",
    [
        ArduCopterLegs(),
        ArduCopterLegs(acceleration=4.0, jerk=10.0),
        Px4Legs(acceleration=5.0, jerk=20.0),
    ],
)
def test_a_leg_and_the_speed_reached_on_it_are_one_law(legs: LegLimits) -> None:
    speeds = np.array([0.3, 1.0, 5.0, 12.0])
    assert legs.reachable_speed(legs.shortest_leg(speeds)) == pytest.approx(speeds, rel=5e-3)


def test_a_px4_leg_is_one_in_which_it_can_stop() -> None:
    legs = Px4Legs(acceleration=5.0, jerk=10.0)
    d, b = legs.shortest_leg(np.array([1.0, 4.0, 8.0])), 10.0
    assert (-b + np.sqrt(b**2 + 8 * 5.0 * d)) / 2 == pytest.approx([1.0, 4.0, 8.0])


@pytest.mark.parametrize(
    ("autopilot", "parameters", "legs"),
    [
        ("ardupilot", {}, ArduCopterLegs(acceleration=2.5, jerk=1.0)),
        (
            "ardupilot",
            {"WPNAV_ACCEL": 400, "WPNAV_JERK": 10},
            ArduCopterLegs(acceleration=4.0, jerk=10.0),
        ),
        ("ardupilot", {"WP_ACC": 4.0, "WP_JERK": 10}, ArduCopterLegs(acceleration=4.0, jerk=10.0)),
        ("ardupilot", {"WP_ACC": 3.0, "WPNAV_ACCEL": 400}, ArduCopterLegs(acceleration=3.0)),
        ("px4", {"WPNAV_ACCEL": 400}, Px4Legs(acceleration=3.0, jerk=4.0)),
        ("px4", {"MPC_ACC_HOR": 5, "MPC_JERK_AUTO": 20}, Px4Legs(acceleration=5.0, jerk=20.0)),
    ],
)
def test_parameters_of_either_generation(
    autopilot: str, parameters: dict[str, float], legs: ArduCopterLegs | Px4Legs
) -> None:
    assert plan_with(autopilot=autopilot, parameters=parameters).aircraft.legs == legs


def test_an_unusable_parameter_is_named() -> None:
    with pytest.raises(InputError, match=r"plan: vehicle\.parameters: WPNAV_JERK: 0; give"):
        _ = plan_with(parameters={"WPNAV_JERK": 0.0}).aircraft.legs
