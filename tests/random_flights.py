"""Feasible flights and maps of gains drawn at random, for the tests of bounds."""

from dataclasses import replace

import numpy as np

from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.radio.gain_map import Grid


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


def with_maps(problem: Problem, seed: int) -> Problem:
    """Return `problem` with shadows of 20 dB that end within a cell above both hops' laws."""
    x, y, links = np.linspace(-40.0, 110.0, 12), np.linspace(-33.0, 107.0, 15), []
    for hop, link in enumerate(problem.links):
        shadow = np.random.default_rng(seed + hop).random((12, 15)) < 0.4
        above = Grid.through(x, y, np.where(shadow, -20.0, 0.0))
        links.append(replace(link, gains=replace(link.gains, above=above)))
    return replace(problem, bs_uav=links[0], uav_user=links[1])
