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


def rough_grid(seed: int, cells: int = 12, low: float = -40.0, high: float = 110.0) -> Grid:
    """Return shadows of 20 dB that end within a cell."""
    rng = np.random.default_rng(seed)
    x, y = np.linspace(low, high, cells), np.linspace(low + 7, high - 3, cells + 3)
    return Grid.through(x, y, np.where(rng.random((cells, cells + 3)) < 0.4, -20.0, 0.0))


def with_maps(problem: Problem, seed: int) -> Problem:
    """Return `problem` with a rough grid above the laws of either hop."""
    first, second = (
        replace(link, gains=replace(link.gains, above=rough_grid(seed + hop)))
        for hop, link in enumerate(problem.links)
    )
    return replace(problem, bs_uav=first, uav_user=second)
