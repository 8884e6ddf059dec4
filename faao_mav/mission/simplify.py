"""Few waypoints for a stretch of flight: Ramer-Douglas-Peucker in space and time."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real
from faao_mav.mission.autopilot import Legs
from faao_mav.mission.vector import distances_to_segment, lengths

Flags: TypeAlias = NDArray[np.bool_]

SHORTEST_LEG = 2.0
"""Legs made only for the timing's sake are never shorter, m."""


def simplify(t: Real, w: Real, legs: Legs, max_speed: float, tolerance: float) -> list[int]:
    """Return the indices between the first and the last sample that become waypoints.

    A leg is split where its error at equal times, |w(t) - (linear in time between its ends)|, is
    largest, as long as that exceeds `tolerance` and both parts are legs that the aircraft can
    use (`legs.shortest_leg` of their mean speed). A leg that cannot be split so, but leaves the
    path by more than `tolerance`, is split where it does so most: what is flown stays on the
    path even where the timing suffers. Points of such a split are more than `tolerance` apart.

    `t` (n,) s and `w` (n, 2) m, n >= 2, are the stretch with both its ends; every sample is
    within `tolerance` (m) of the polyline through the ends and the result. `max_speed` is in m/s.
    """
    kept = []
    open_legs = [(0, len(t) - 1)]
    while open_legs:
        first, last = open_legs.pop()
        split = _split(t[first : last + 1], w[first : last + 1], legs, max_speed, tolerance)
        if split is not None:
            kept.append(first + split)
            open_legs += [(first, first + split), (first + split, last)]
    return sorted(kept)


def _split(t: Real, w: Real, legs: Legs, max_speed: float, tolerance: float) -> int | None:
    """Return the index at which the leg from w[0] to w[-1] is to be split, or None."""
    if len(t) < 3:
        return None
    chord = w[-1] - w[0]
    late = lengths(w[0] + np.outer((t - t[0]) / (t[-1] - t[0]), chord) - w)
    usable = _usable(t - t[0], w - w[0], legs, max_speed)
    usable &= _usable(t[-1] - t, w[-1] - w, legs, max_speed)
    candidates = np.where(usable, late, 0.0)
    best = int(np.argmax(candidates))
    if candidates[best] > tolerance:
        return best
    astray = distances_to_segment(w, w[0], w[-1])
    farthest = int(np.argmax(astray))
    return farthest if astray[farthest] > tolerance else None


def _usable(durations: Real, chords: Real, legs: Legs, max_speed: float) -> "Flags":
    """Return for each leg of `durations` (n,) and `chords` (n, 2) if the aircraft can use it."""
    length = lengths(chords)
    speeds = np.divide(length, durations, out=np.zeros_like(length), where=durations > 0)
    least = legs.shortest_leg(np.minimum(speeds, max_speed))
    result: Flags = length >= np.maximum(least, SHORTEST_LEG)
    return result
