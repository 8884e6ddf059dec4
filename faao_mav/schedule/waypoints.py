"""Where waypoints go on a trajectory: at hovers and at the ends of long legs.

Constants that name no source are chosen; what a change costs is not measured.
"""

import math
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.vector import distances_to_segment, lengths

DIGITS = 3
"""Decimals of all values of a route, in m, m/s and s, as they are flown and sent.

Far above the noise of a processor's rounding (1e-9 and less), far below what a flight shows; with
speeds of two, 300 s of flight end 0.25 s off.
"""


# The share of the path tolerance by which a sample may be from its leg, and from its hover.
LEG_SHARE = 0.9

SLOWEST = 0.1  # the least speed, m/s, that any autopilot is commanded: a slower trajectory hovers

# The largest radius of a hover, m, however large the path tolerance. Chosen: two hovers with a
# metre's creep between them are flown by legs of 1 to 2 m and reversals, on which ArduCopter was up
# to 0.8 s later than predicted.
_WIDEST_HOVER = 1.5

SHORTEST_HOVER = 3.0  # the shortest hover, s: a shorter stop is flown as slow flight

# A plan that brakes as hard as it may swings past a hover and comes back, or backs up to leave it.
# Reversals on legs of a metre or two took ArduCopter up to 0.9 s longer than predicted, measured in
# its simulator, so swings of up to so many times a hover's radius belong to the hover.
_SWING = 1.5
_SHIFTS = 10  # shifts of a hover towards its farthest swing, until that is at its radius,
_NEARLY = 1e-3  # or beyond it by this share

_SPEED_WINDOW = 1.0  # s, over which a speed is averaged first: it hides a trajectory's chatter
_BISECTIONS = 8  # halvings of the tolerance that evens out legs: it is found to 1/256


@dataclass(frozen=True, slots=True, eq=False)
class Waypoint:
    """A waypoint at `position` (2,), m: the plan is there from sample `first` to sample `last`."""

    first: int
    last: int
    position: Real


def find_hovers(t: Real, w: Real, radius: float, slowest: float = SLOWEST) -> list[Waypoint]:
    """Return the hovers of the trajectory `t` (n,) s, `w` (n, 2) m, in order.

    A hover lasts 3 s at least, in which the aircraft is slower than `slowest` m/s throughout and
    stays in a box with a half diagonal of at most `radius` (m). Its position is the median, or the
    box's middle if a sample is farther than `radius` from the median. A creep through several boxes
    makes several hovers, with 3 s between them to get on. A plan may dither about a place: where
    there is no other hover, it is slow if its mean velocity over 3 s is.

    >>> t = np.arange(0.0, 20.0)
    >>> w = np.column_stack([np.clip(t - 10, 0, None), 0 * t])
    >>> [(hover.first, hover.last) for hover in find_hovers(t, w, 0.5)]
    [(0, 9)]
    """
    hovers: list[Waypoint] = []
    for window in (_SPEED_WINDOW, SHORTEST_HOVER):
        slow = _speeds(t, w, window) < slowest
        hovers += [new for new in _boxed(t, w, slow, radius) if _is_apart(t, new, hovers)]
    return sorted(hovers, key=lambda hover: hover.first)


def _boxed(t: Real, w: Real, slow: Flags, radius: float) -> list[Waypoint]:
    """Return the hovers in each run of `slow` samples (n,)."""
    hovers = []
    for begin, end in _runs(slow):
        first = begin
        while first < end:
            last = _last_within(w[first : end + 1], radius) + first
            if t[last] - t[first] >= SHORTEST_HOVER:
                hovers.append(Waypoint(first, last, _middle(w[first : last + 1], radius)))
                first = int(np.searchsorted(t, t[last] + SHORTEST_HOVER))
            else:
                first += 1
    return hovers


def _is_apart(t: Real, new: Waypoint, hovers: list[Waypoint]) -> bool:
    begin, end = t[new.first] - SHORTEST_HOVER, t[new.last] + SHORTEST_HOVER
    return all(t[known.last] < begin or t[known.first] > end for known in hovers)


def hovers_and_ends(t: Real, w: Real, tolerance: float, slowest: float) -> list[Waypoint]:
    """Return the waypoints between which a trajectory moves: w_I, the hovers, w_F.

    `t` (n,) s, `w` (n, 2) m; `tolerance` is the path tolerance, m; slower than `slowest` m/s it may
    hover. A hover at an end takes the end's exact position; a flight that stays is one.
    """
    end = len(t) - 1
    closed = math.dist(w[0], w[end]) <= 10**-DIGITS
    radius = LEG_SHARE * tolerance
    if closed and lengths(w - w[0]).max() <= tolerance:
        return [Waypoint(0, end, w[end])]
    hovers = find_hovers(t, w, min(_WIDEST_HOVER, radius), slowest)
    if hovers and hovers[0].first == 0:
        _, last = _around(lengths(w - w[0]) <= radius, 0, 0, hovers[0].last)
        if last == end and not closed:
            last -= 1  # two ends in one hover: leave a leg between them
        hovers[0] = Waypoint(0, last, w[0])
    else:
        hovers.insert(0, Waypoint(0, 0, w[0]))
    if hovers[-1].last == end:
        first, _ = _around(lengths(w - w[end]) <= radius, end, hovers[-1].first, end)
        hovers[-1] = Waypoint(first, end, w[end])
    else:
        hovers.append(Waypoint(end, end, w[end]))

    for k in range(1, len(hovers) - 1):
        begin, end = hovers[k - 1].last + 1, hovers[k + 1].first - 1
        hovers[k] = _with_swings(w, hovers[k], begin, end, radius)
    return hovers


def simplify(w: Real, tolerance: float) -> list[int]:
    """Return the indices between the first and the last sample that become waypoints.

    Each leg goes as far as the samples it passes over stay within `tolerance` (m) of it. With the
    number of legs that this takes, the least tolerance is sought that takes no more: legs in a
    bend are then of one length, where taking each as long as possible would leave a short last
    one, on which an autopilot crawls.

    `w` (n, 2) m, n >= 2, are the stretch with both its ends; every sample is within `tolerance`
    of the polyline through the ends and the result.

    >>> angle = np.linspace(0, np.pi / 2, 91)
    >>> simplify(100 * np.column_stack([np.cos(angle), np.sin(angle)]), 1.0)
    [15, 30, 45, 60, 75]
    """
    best = _longest_legs(w, tolerance)
    low, high = 0.0, tolerance
    for _ in range(_BISECTIONS if best else 0):
        middle = (low + high) / 2
        points = _longest_legs(w, middle)
        if len(points) <= len(best):
            best, high = points, middle
        else:
            low = middle
    return best


def _speeds(t: Real, w: Real, window: float) -> Real:
    """Return the magnitude of the mean velocity over `window` s about each sample, (n,), m/s."""
    before = np.maximum(t - window / 2, t[0])
    after = np.minimum(t + window / 2, t[-1])
    moved = [np.interp(after, t, x) - np.interp(before, t, x) for x in w.T]
    means: Real = np.stack(moved, axis=-1) / (after - before)[:, None]
    return lengths(means)


def _runs(mask: Flags) -> Iterator[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    for begin, end in edges.reshape(-1, 2):
        yield int(begin), int(end) - 1


def _middle(w: Real, radius: float) -> Real:
    """Return a place (2,), m, that all of `w` (n, 2), in a box of half diagonal `radius`, are near.

    The median is where the plan stays longest.
    """
    median: Real = np.median(w, axis=0)
    near = lengths(w - median).max() <= radius
    return median if near else (w.min(axis=0) + w.max(axis=0)) / 2


def _with_swings(w: Real, hover: Waypoint, begin: int, end: int, radius: float) -> Waypoint:
    """Return `hover` with the swings around it, moved so that they stay within `radius` m.

    A swing leaves it by up to `_SWING` radii and comes back; it is among the samples `begin` to
    `end` of `w` (n, 2) m. Where no place is near enough to all swings the hover is left alone.
    """
    apart, position = lengths(w - hover.position), hover.position
    first, last = _around(apart <= _SWING * radius, hover.first, begin, end)
    inside = first + np.flatnonzero(apart[first : last + 1] <= radius)
    swings = np.arange(inside[0], inside[-1] + 1)
    swings = swings[apart[swings] > radius]
    if len(swings) == 0:
        return hover
    for _ in range(_SHIFTS):
        away = w[swings] - position
        farthest = away[np.argmax(lengths(away))]
        position = position + max(0.0, 1 - radius / lengths(farthest)) * farthest
    near = lengths(w - position) <= (1 + _NEARLY) * radius
    if not (near[hover.first : hover.last + 1].all() and near[swings].all()):
        return hover
    return Waypoint(*_around(near, hover.first, first, last), position)


def _around(mask: Flags, at: int, begin: int, end: int) -> tuple[int, int]:
    """Return first and last index of the run of True about `at`, within `begin` and `end`."""
    outside = np.flatnonzero(~mask)
    k = int(np.searchsorted(outside, at))
    first = int(outside[k - 1]) + 1 if k else 0
    last = int(outside[k]) - 1 if k < len(outside) else len(mask) - 1
    return max(first, begin), min(last, end)


def _last_within(w: Real, radius: float) -> int:
    """Return the last index up to which the bounding box's half diagonal is within `radius`."""
    extent = np.maximum.accumulate(w, axis=0) - np.minimum.accumulate(w, axis=0)
    outside = lengths(extent) / 2 > radius
    return int(np.argmax(outside)) - 1 if outside.any() else len(w) - 1


def _longest_legs(w: Real, tolerance: float) -> list[int]:
    """Return the indices at which legs end if each is as long as `tolerance` (m) allows."""
    ends, first, last = list[int](), 0, len(w) - 1
    while first < last:
        strays, step = partial(_strays, w, tolerance, first), 1
        while first + step < last and not strays(min(first + 2 * step, last)):
            step *= 2
        farther = range(first + step + 1, min(first + 2 * step, last))
        first += step + bisect_left(farther, True, key=strays)
        ends.append(first)
    return ends[:-1]


def _strays(w: Real, tolerance: float, first: int, last: int) -> bool:
    passed = w[first + 1 : last]
    apart = distances_to_segment(passed, w[first], w[last])
    return bool(apart.max(initial=0.0) > tolerance)
