"""How long a leg has to be."""

import numpy as np
import pytest

from faao_mav.autopilot.ardupilot.copter import ArduCopter
from faao_mav.autopilot.px4 import Px4


def test_measured_lengths_of_arducopter_legs() -> None:
    """Measured at 8 m/s: 49 m with default parameters, 22 m with ACCEL 400 and JERK 10."""
    for limits, length in (((2.5, 1.0), 49), ((4.0, 10.0), 22)):
        legs = ArduCopter(acceleration=limits[0], jerk=limits[1])
        assert legs.shortest_leg(np.array(8.0)) == pytest.approx(length, abs=1)


def test_a_leg_and_the_speed_reached_on_it_are_one_law() -> None:
    speeds = np.array([0.3, 1.0, 5.0, 12.0])
    for legs in (ArduCopter(), ArduCopter(acceleration=4.0, jerk=10.0), Px4(jerk=20.0)):
        assert legs.reachable_speed(legs.shortest_leg(speeds)) == pytest.approx(speeds, rel=5e-3)
