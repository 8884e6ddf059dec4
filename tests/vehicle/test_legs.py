"""How long a leg has to be."""

import numpy as np
import pytest
from relay_flights import plan_with

from faao_mav.errors import InputError
from faao_mav.mission.vehicle import vehicle_of
from faao_mav.vehicle.legs import ArduCopterLegs, Px4Legs, legs_of


def test_measured_lengths_of_arducopter_legs():
    # Measured at 8 m/s: 49 m with default parameters, 22 m with ACCEL 400 and JERK 10.
    assert ArduCopterLegs().shortest_leg(np.array(8.0)) == pytest.approx(49, abs=1)
    assert ArduCopterLegs(4.0, 10.0).shortest_leg(np.array(8.0)) == pytest.approx(22, abs=1)


def test_a_ramp_too_short_to_reach_the_acceleration_joins_the_long_one():
    legs = ArduCopterLegs()
    change = legs.acceleration**2 / legs.jerk + 0.3 * legs.acceleration
    below, above = legs.ramp_duration(np.array([change - 1e-9, change + 1e-9]))
    assert below == pytest.approx(above, abs=1e-6)
    assert legs.ramp_duration(np.array(0.0)) == pytest.approx(0.6)


def test_a_px4_leg_is_one_in_which_it_can_stop():
    legs = Px4Legs(5.0, 10.0)
    d, b = legs.shortest_leg(np.array([1.0, 4.0, 8.0])), 10.0
    assert (-b + np.sqrt(b**2 + 8 * 5.0 * d)) / 2 == pytest.approx([1.0, 4.0, 8.0])


@pytest.mark.parametrize(
    ("autopilot", "parameters", "legs"),
    [
        ("ardupilot", {}, ArduCopterLegs(2.5, 1.0)),
        ("ardupilot", {"WPNAV_ACCEL": 400, "WPNAV_JERK": 10}, ArduCopterLegs(4.0, 10.0)),
        ("ardupilot", {"WP_ACC": 4.0, "WP_JERK": 10}, ArduCopterLegs(4.0, 10.0)),
        ("ardupilot", {"WP_ACC": 3.0, "WPNAV_ACCEL": 400}, ArduCopterLegs(3.0, 1.0)),
        ("px4", {"WPNAV_ACCEL": 400}, Px4Legs(3.0, 4.0)),
        ("px4", {"MPC_ACC_HOR": 5, "MPC_JERK_AUTO": 20}, Px4Legs(5.0, 20.0)),
    ],
)
def test_parameters_of_either_generation(autopilot, parameters, legs):
    assert legs_of(vehicle_of(plan_with(autopilot=autopilot, parameters=parameters))) == legs


def test_an_unusable_parameter_is_named():
    with pytest.raises(InputError, match=r"plan: vehicle\.parameters\.WPNAV_JERK: 0; give"):
        legs_of(vehicle_of(plan_with(parameters={"WPNAV_JERK": 0.0})))
