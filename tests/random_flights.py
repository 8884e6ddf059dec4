"""Feasible flights drawn at random, for the tests of bounds."""

import numpy as np

from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.search.straight import straight_flight


def random_flight(kin: Kinematics, seed: int) -> Trajectory:
    """A feasible flight: the straight one, bent as far as the limits allow."""
    rng, straight = np.random.default_rng(seed), straight_flight(kin)
    bend = rng.uniform(0, 3) * rng.standard_normal(2) + rng.standard_normal(straight.a.shape)
    size = 1.0
    while size > 1e-3:
        flight = kin.integrate(straight.v[0], straight.a + size * bend)
        if max(kin.residuals(flight).values()) < 1e-9:
            return flight
        size *= 0.8
    return straight
