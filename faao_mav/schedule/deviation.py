"""How far a flight is from the plan: at equal times, and from the path."""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Real
from faao_mav.vector import lengths


@dataclass(frozen=True, slots=True)
class Deviation:
    """Metres between flown and planned.

    `rms` and `max` compare positions at equal times, `path` is the farthest that either path
    strays from the other.
    """

    rms: float
    max: float
    path: float


def deviation(planned: Real, flown: Real, path: Real) -> Deviation:
    """Compare positions `planned` and `flown` (n, 2) at the same n instants.

    `path` (m, 2) is the flown path in between, as finely sampled as it curves.
    """
    apart = lengths(flown - planned)
    return Deviation(
        rms=float(np.sqrt(np.mean(apart**2))),
        max=float(apart.max()),
        path=float(max(astray(path, planned).max(), astray(planned, path).max())),
    )


def astray(points: Real, path: Real) -> Real:
    """Return the distance of each of `points` (n, 2) from the polyline `path` (m, 2), (n,)."""
    if len(path) == 1:
        return lengths(points - path[0])
    begin, chord = path[:-1].T, np.diff(path, axis=0).T
    square = chord[0] ** 2 + chord[1] ** 2
    square[square == 0] = 1.0
    result = np.empty(len(points))
    rows = max(1, _CELLS // len(square))
    for first in range(0, len(points), rows):
        some = points[first : first + rows, :, None]
        east, north = some[:, 0] - begin[0], some[:, 1] - begin[1]
        share = np.clip((east * chord[0] + north * chord[1]) / square, 0, 1)
        east -= share * chord[0]
        north -= share * chord[1]
        result[first : first + rows] = np.sqrt((east**2 + north**2).min(axis=1))
    return result


def settled(t: Real, w: Real, end: Real, near: float, due: float) -> float:
    """Return when a flight at `w` (k, 2) m at `t` (k,) s comes within `near` m of `end` for good.

    One that goes on past `end` does so when it last comes near before it is closest. It may have
    been there before: at `due`, s, it is expected there, and a metre nearer is worth two seconds.
    """
    apart = lengths(w - end)
    arrived = int(np.argmin(apart + np.abs(t - due) / 2))
    outside = np.flatnonzero(apart[:arrived] > near)
    if len(outside) == 0:
        return float(t[0])
    k = int(outside[-1])
    share = (apart[k] - near) / (apart[k] - apart[k + 1])
    return float(t[k] + max(0.0, min(1.0, share)) * (t[k + 1] - t[k]))


def passing(t: Real, w: Real, place: Real, about: float) -> float:
    """Return when a flight at `w` (k, 2) m at `t` (k,) s is closest to `place` (2,) m, s.

    That is at `about`, s, or soon after: an autopilot takes a waypoint as reached where it is
    within a radius of it.
    """
    first, last = np.searchsorted(t, [about - _SOON, about + _SOON])
    t, w = t[first:last], w[first:last]
    steps = np.diff(w, axis=0)
    along = np.sum((place - w[:-1]) * steps, axis=1)
    share = np.clip(along / np.maximum(np.sum(steps**2, axis=1), 1e-9), 0.0, 1.0)
    k = int(np.argmin(lengths(w[:-1] + share[:, None] * steps - place)))
    return float(t[k] + share[k] * (t[k + 1] - t[k]))


_SOON = 3.0  # s
_CELLS = 1 << 14  # pairs of point and leg held at once: what stays in a processor's cache is fast
