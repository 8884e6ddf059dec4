"""Paths to fly."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from faao_mav.autopilot import Model
from faao_mav.autopilot.model import FlightPath


def path_of(
    places: Sequence[complex],
    speed: float | Sequence[float] = 8.0,
    *,
    radius: float = 0.0,
    holds: dict[int, float] | None = None,
    heights: Sequence[float] | None = None,
) -> FlightPath:
    """Return the path through `places`, east + i north, at `heights` or 30 m up."""
    count = len(places)
    up = np.full(count, 30.0) if heights is None else np.array(heights, dtype=float)
    where = np.array(places, dtype=complex)
    waits = np.zeros(count)
    for point, seconds in (holds or {}).items():
        waits[point] = seconds
    return FlightPath(
        np.stack([where.real, where.imag, up], axis=-1),
        np.broadcast_to(np.array(speed, dtype=float), (count - 1,)).copy(),
        waits,
        np.zeros(count, dtype=bool),
        np.full(count, radius),
    )


def line(spacing: float, legs: int, speed: float | Sequence[float] = 8.0) -> FlightPath:
    return path_of([complex(spacing * k) for k in range(legs + 1)], speed)


@st.composite
def wandering(draw: st.DrawFn, *, shortest: float = 5.0, climbs: bool = False) -> FlightPath:
    """Paths of a few legs with any turns, speeds and holds."""
    legs = draw(st.integers(1, 5))
    lengths = draw(st.lists(st.floats(shortest, 120), min_size=legs, max_size=legs))
    turns = draw(st.lists(st.floats(-3.1, 3.1), min_size=legs, max_size=legs))
    speeds = draw(st.lists(st.floats(1, 12), min_size=legs, max_size=legs))
    holds = draw(st.dictionaries(st.integers(0, legs), st.floats(0.5, 20), max_size=2))
    steps = np.array(lengths) * np.exp(1j * np.cumsum(turns))
    heights = None
    if climbs:
        heights = draw(st.lists(st.floats(20, 60), min_size=legs + 1, max_size=legs + 1))
    return path_of([0j, *np.cumsum(steps)], speeds, holds=holds, heights=heights)


def bends(seed: int) -> FlightPath:
    """Return a path of 14 legs in gentle bends, with a hold."""
    rng = np.random.default_rng(seed)
    turns, lengths = rng.uniform(-0.25, 0.25, 14), rng.uniform(12, 30, 14)
    places = [0j, *np.cumsum(lengths * np.exp(1j * np.cumsum(turns)))]
    return path_of(places, list(rng.uniform(3, 8, 14)), holds={7: 6.0})


def roughness(model: Model, path: FlightPath, leg: int) -> float:
    """Return how far the arrival is from a smooth function of the speed of a `leg`, s."""
    change, one = np.linspace(-0.02, 0.02, 41), np.eye(len(path.speeds))[leg]
    tried = [replace(path, speeds=path.speeds + each * one) for each in change]
    arrivals = np.array([model.fly(each).arrivals[-1] for each in tried])
    noise = arrivals - np.polyval(np.polyfit(change, arrivals, 3), change)
    return float(abs(noise).max())
