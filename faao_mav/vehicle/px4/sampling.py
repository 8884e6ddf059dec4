"""From a simulation's own steps to uniform times."""

import math
from collections.abc import Sequence

import numpy as np

from faao_mav.arrays import Real
from faao_mav.vehicle.flight_path import Flown
from faao_mav.vehicle.px4.simulation import FlightLog


def grid(end: float, step: float) -> Real:
    """Return the multiples of `step` from 0 to the first that is at least `end`."""
    return np.arange(math.ceil(end / step - 1e-9) + 1, dtype=float) * step


def sampled(logs: Sequence[FlightLog], height: float, step: float) -> list[Flown]:
    """Return the flights of `logs` every `step` seconds up to the latest end.

    `height` m is that of a path that does not climb.
    """
    t = grid(max(float(log.departures[-1]) for log in logs), step)
    flights = []
    for log in logs:
        place, velocity = _between(t, log.time, log.motion)
        if place.shape[1] == 2:
            place = np.column_stack([place, np.full(len(t), height)])
            velocity = np.column_stack([velocity, np.zeros(len(t))])
        flights.append(Flown(log.arrivals, log.departures, t, place, velocity))
    return flights


def _between(t: Real, time: Real, motion: Real) -> tuple[Real, Real]:
    """Return places and velocities (len(t), n): cubic and linear between samples (k, 2, n)."""
    left = np.clip(np.searchsorted(time, t, side="right") - 1, 0, len(time) - 2)
    right = left + 1
    width = (time[right] - time[left])[:, None]
    s = np.clip((t - time[left])[:, None] / np.maximum(width, 1e-9), 0.0, 1.0)
    rest = 1 - s
    (place_left, velocity_left), (place_right, velocity_right) = (
        motion[side].swapaxes(0, 1) for side in (left, right)
    )
    bends = rest * velocity_left - s * velocity_right
    places = (
        rest * rest * (1 + 2 * s) * place_left
        + s * s * (3 - 2 * s) * place_right
        + s * rest * width * bends
    )
    return places, rest * velocity_left + s * velocity_right
