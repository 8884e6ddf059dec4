"""Paths to fly."""

from collections.abc import Sequence

import numpy as np
from hypothesis import strategies as st

from faao_mav.autopilot.model import FlightPath


def path_of(
    places: Sequence[complex],
    speed: float | Sequence[float] = 8.0,
    *,
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
        np.zeros(count),
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
