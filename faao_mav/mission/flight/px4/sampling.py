"""From a simulation's own steps to uniform times."""

import math

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.mission.flight.path import Flown
from faao_mav.mission.flight.px4.simulation import Log


def grid(end: float, step: float) -> Real:
    """Return the multiples of `step` from 0 to the first that is at least `end`."""
    return np.arange(math.ceil(end / step - 1e-9) + 1, dtype=float) * step


def sampled(log: Log, height: float, step: float) -> Flown:
    """Return the flights of `log` every `step` seconds, arrays with a leading axis of variants.

    `height` m is that of a path that does not climb.
    """
    t = grid(float(log.departures[:, -1].max()), step)
    variants = range(len(log.departures))
    motions = [
        _between(t, log.time[:, k], log.position[..., k], log.velocity[..., k]) for k in variants
    ]
    position = np.stack([_spatial(places, height) for places, _ in motions])
    velocity = np.stack([_spatial(speeds, 0.0) for _, speeds in motions])
    return Flown(log.arrivals, log.departures, t, position, velocity)


def _between(t: Real, time: Real, place: Complex, velocity: Complex) -> tuple[Complex, Complex]:
    """Return places and velocities (len(t), n): cubic and linear between samples (k, n)."""
    left = np.clip(np.searchsorted(time, t, side="right") - 1, 0, len(time) - 2)
    right = left + 1
    width = (time[right] - time[left])[:, None]
    s = np.clip((t - time[left])[:, None] / np.maximum(width, 1e-9), 0.0, 1.0)
    rest = 1 - s
    bends = rest * velocity[left] - s * velocity[right]
    places = (
        rest * rest * (1 + 2 * s) * place[left]
        + s * s * (3 - 2 * s) * place[right]
        + s * rest * width * bends
    )
    return places, rest * velocity[left] + s * velocity[right]


def _spatial(motion: Complex, height: float) -> Real:
    """Return east, north, up (k, 3) of horizontal and, unless there is none, vertical motion."""
    up = motion[:, 1].real if motion.shape[1] > 1 else np.full(len(motion), height)
    return np.stack([motion[:, 0].real, motion[:, 0].imag, up], axis=-1)
