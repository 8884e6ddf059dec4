"""Cells of the map at instants of a flight, and the best sums over them: by position alone.

What is to be had from an instant on is worth to a flight in a cell its reward there and the best of
the cells that it can reach at v_max: a maximum filter with a disc, from the end to the start.
Acceleration enters through how far the flight comes from its ends, fences by cells that are left
out. Cells and steps are rounded outwards, so that no flight is missed.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.mission.fence_area import FARTHEST, FreeArea
from faao_mav.optimizer.kinematics import Kinematics

CORNER = np.sqrt(0.5)
"""Distance of a cell's corners from its centre, in sides of the cell."""

NOWHERE = -1e9
"""What is to be had where no flight can be: less than any bits."""

MOST_INSTANTS = 100
"""Instants of a flight at most, which limits time and memory. Chosen."""


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Cells of the map at K instants of a flight.

    `x` (2, i, j) are the centres of the cells, m, `side` theirs; `blocks` the K runs of slots
    between the first and the last, which are at given places, and `instants` (K,) their mean times,
    s. `alive` (K, i, j) tells where a flight can be at an instant. A `step` from one instant to the
    next is so many sides long, and may pass through an obstacle that is thinner.
    """

    x: Real
    side: float
    blocks: list[Integers]
    instants: Real
    alive: Flags
    step: float


def disc(step: float, beyond: float = 1) -> list[tuple[int, int]]:
    """Return rows to either side, and columns there, from any point of a cell `step` sides away.

    With 0 `beyond` they are from centre to centre, with 0.5 from a centre to any point.

    >>> disc(1.5)
    [(0, 2), (1, 2), (2, 2)]
    """
    return [
        (row, int(np.sqrt(step**2 - max(0, row - beyond) ** 2) + beyond))
        for row in range(int(step + beyond) + 1)
    ]


def largest_near(values: Real, rows: Sequence[tuple[int, int]]) -> Real:
    """Return the largest of `values` (..., i, j) in a `disc` of `rows` about each place."""
    best, count = np.full_like(values, -np.inf), values.shape[-2]
    within = largest_within(values, (columns for _, columns in rows))
    for row, columns in rows[:count]:
        near, above, below = within[columns], best[..., row:, :], best[..., : count - row, :]
        np.maximum(above, near[..., : count - row, :], out=above)
        np.maximum(below, near[..., row:, :], out=below)
    return best


def largest_ahead(values: Real, inside: Flags, reach: float) -> Real:
    """Return the largest of `values` (..., i, j) that a step from each cell leads to.

    A step goes `reach` sides over cells that are `inside` (i, j). Where others are in its reach it
    goes from each to one of its eight neighbours or of its four, as often as makes an octagon of
    about the size of the disc: so it leads around obstacles that are thinner than it is long.
    """
    rows, single = disc(reach, 0), int(reach)
    found, blocked = largest_near(values, rows), largest_near(np.where(inside, 0.0, 1.0), rows) > 0
    if not blocked.any():
        return found
    straight = round(np.clip(2 * single - np.sqrt(2) * reach, 0, single))
    for k in range(single):
        near = largest_near(values, disc(1.0 if k < straight else 1.5, 0))
        values = np.where(inside, near, NOWHERE)
    return np.where(blocked, values, found)


def largest_within(values: Real, reaches: Iterable[int]) -> dict[int, Real]:
    """Return for each of `reaches` the largest of `values` (..., n) up to so many places away.

    >>> largest_within(np.array([3.0, 0.0, 1.0, 0.0]), [1])[1].tolist()
    [3.0, 3.0, 1.0, 1.0]
    """
    from scipy.ndimage import maximum_filter1d  # 0.15 s, and seldom needed

    return {
        reach: maximum_filter1d(values, 2 * reach + 1, mode="constant", cval=-np.inf)
        for reach in set(reaches)
    }


def cells_of(
    kin: Kinematics, places: Real, cells: int, reach: float, free: FreeArea | None = None
) -> Cells:
    """Return about so many `cells`, with steps that reach about so many, for flights of `kin`.

    The map is a box about the ends, `places` (k, 2), m, and obstacles. A flight beyond it has a
    projection on it that keeps the limits used here and meets no obstacle; with the right `places`
    it has no less gain. `free` is where the aircraft may be, everywhere if None.
    """
    corners = np.vstack([kin.start, kin.end, places])
    since, until = kin.longest_ways()
    if free is not None:
        import shapely

        rings = shapely.get_coordinates(free.shape)
        inner = rings[np.abs(rings).max(axis=1) < 0.99 * FARTHEST]
        reached = kin.start - since[-1], kin.start + since[-1]  # corners beyond are drawn nearer
        corners = np.vstack([corners, np.clip(inner, *reached)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    extent = np.maximum(high - low, 1.0)  # stations and ends may lie on one line
    duration = kin.time_step * (kin.slots - 1)
    side = max(
        float(np.sqrt(extent.prod() / cells)), kin.max_speed * duration / (reach * MOST_INSTANTS)
    )
    margin = 0 if free is None else 2  # no obstacle reaches the edge of the map
    axes = [
        first + side * np.arange(-margin, int(np.ceil(length / side)) + 1 + margin)
        for first, length in zip(low, extent, strict=True)
    ]
    x = np.stack(np.meshgrid(*axes, indexing="ij"))
    t = kin.time_step * np.arange(kin.slots)
    inner = np.arange(1, kin.slots - 1)
    slots = max(1, round(reach * side / (kin.max_speed * kin.time_step)))
    blocks = np.array_split(inner, max(1, min(len(inner) // slots, MOST_INSTANTS)))
    instants = np.array([t[block].mean() for block in blocks])
    alive = np.ones((len(blocks), *x.shape[1:]), dtype=np.bool_)
    for end, ways in ((kin.start, since), (kin.end, until)):
        # the way is convex in time up to v_max and straight beyond: never above its chords
        way = np.interp(instants, t, ways) + CORNER * side
        alive &= np.hypot(*(x - end[:, None, None])) <= way[:, None, None]
    if free is not None:
        area = FreeArea(free.shape.buffer(CORNER * side))
        alive &= area.covers(x.reshape(2, -1).T).reshape(x.shape[1:])
    step = kin.max_speed * float(np.diff(instants).max(initial=0.0)) / side
    return Cells(x, side, blocks, instants, alive, step)
