"""Where a trajectory hovers."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real
from faao_mav.vector import lengths

SHORTEST_HOVER = 3.0
"""A stop shorter than this is only slow flight, s."""

SLOWEST = 0.1
"""No leg is commanded slower, m/s, so this is where hovers begin."""

_WINDOW = 1.0
"""Speeds are means over this: it hides a trajectory's chatter and is short for a ramp, s."""


@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """The slots `first` to `last` (inclusive), spent at `position` (2,), m."""

    first: int
    last: int
    position: Real


def find_hovers(t: Real, w: Real, radius: float) -> list[Stop]:
    """Return the hovers of the trajectory `t` (n,) s, `w` (n, 2) m, in order.

    A hover lasts at least `SHORTEST_HOVER` seconds, in which the aircraft is slower than
    `SLOWEST` throughout and stays in a box with a half diagonal of at most `radius` (m). Its
    position is the median, so no sample of a hover is farther than 2 `radius` from it. A creep
    through several boxes makes several hovers, with `SHORTEST_HOVER` between them to get on.
    """
    hovers = []
    for begin, end in _runs(_speeds(t, w) < SLOWEST):
        first = begin
        while first < end:
            last = _last_within(w[first : end + 1], radius) + first
            if t[last] - t[first] >= SHORTEST_HOVER:
                hovers.append(Stop(first, last, np.median(w[first : last + 1], axis=0)))
                first = int(np.searchsorted(t, t[last] + SHORTEST_HOVER))
            else:
                first += 1
    return hovers


def _speeds(t: Real, w: Real) -> Real:
    """Return the magnitude of the mean velocity over a window about each sample, (n,), m/s."""
    before = np.maximum(t - _WINDOW / 2, t[0])
    after = np.minimum(t + _WINDOW / 2, t[-1])
    moved = [np.interp(after, t, x) - np.interp(before, t, x) for x in w.T]
    means: Real = np.stack(moved, axis=-1) / (after - before)[:, None]
    return lengths(means)


def _runs(mask: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Yield first and last index of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    for begin, end in edges.reshape(-1, 2):
        yield int(begin), int(end) - 1


def _last_within(w: Real, radius: float) -> int:
    """Return the last index up to which the bounding box's half diagonal is within `radius`."""
    extent = np.maximum.accumulate(w, axis=0) - np.minimum.accumulate(w, axis=0)
    outside = lengths(extent) / 2 > radius
    return int(np.argmax(outside)) - 1 if outside.any() else len(w) - 1
