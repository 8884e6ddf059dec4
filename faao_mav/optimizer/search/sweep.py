"""Dynamic programming over the map: the best flights through fields of rewards, by position alone.

The flight is looked at at K instants, a few slots apart, and the map in square cells. What the
rewards from instant k on are worth to a flight in a cell, U_k, is its reward there and the best
U_{k+1} of the cells that it can reach at v_max: a maximum filter with a disc, from the end to the
start. The same from the start on, F_k, says what the best flight through a cell at instant k is
worth. Acceleration enters through how far the flight comes from its ends, fences by cells that are
left out.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.mission.fence_area import FARTHEST, FreeArea
from faao_mav.optimizer.kinematics import Kinematics

CORNER = np.sqrt(0.5)
"""Distance of a cell's corners from its centre, in sides of the cell."""

_FENCED_REACH = 4.0
"""Cells that a step reaches beside a fence, about: what is thinner may be passed through. Chosen.
Fewer make flights faster in a map that is rounded outwards, by a cell for each stage."""

_THINNEST = 0.02
"""Least width of the map, in its length: stations and ends may lie on one line. Chosen."""


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """Cells of the map at K instants of a flight.

    `x` (2, i, j) are the centres of the cells, m, `side` theirs; `blocks` the K runs of slots
    between the first and the last, which are at given places, and `instants` (K,) their mean times,
    s. `alive` (K, i, j) tells where a flight can be at an instant, `free` (i, j) where the fence
    lets it be. A step from one instant to the next has `stages`, which all end in `free`;
    `rows` is what one of these reaches: by how many rows to either side, and how many columns to
    either side there.
    """

    x: Real
    side: float
    blocks: list[Integers]
    instants: Real
    alive: Flags
    rows: list[tuple[int, int]]
    stages: int
    free: Flags

    def backward(self, rewards: Real) -> Real:
        """Return U (K, ..., i, j): the best sum from each instant on, its own reward included.

        `rewards` (K, ..., i, j) are those of the instants; -inf where no flight can be.
        """
        out = np.empty_like(rewards)
        out[-1] = rewards[-1]
        for k in range(len(rewards) - 2, -1, -1):
            out[k] = rewards[k] + self.reached(out[k + 1])
        return out

    def through(self, rewards: Real) -> Real:
        """Return what the best flight through each cell at each instant is worth, as `rewards`."""
        after, before = self.backward(rewards), self.backward(rewards[::-1])[::-1]
        with np.errstate(invalid="ignore"):  # -inf - -inf: nobody comes there
            return np.nan_to_num(after + before - rewards, nan=-np.inf, neginf=-np.inf)

    def reached(self, values: Real) -> Real:
        """Return the largest of `values` (..., i, j) in reach of one step."""
        return self._near(self._stages(values)[-1])

    def _stages(self, values: Real) -> list[Real]:
        """Return the largest of `values` in reach after 0, 1, ... `stages` - 1 stages of a step."""
        after = [values]
        for _ in range(self.stages - 1):
            after.append(np.where(self.free, self._near(after[-1]), -np.inf))
        return after

    def _near(self, values: Real) -> Real:
        """Return the largest of `values` (..., i, j) in reach of one stage."""
        best = np.full_like(values, -np.inf)
        within = largest_within(values, (columns for _, columns in self.rows))
        for rows, columns in self.rows:
            near = within[columns]
            if rows == 0:
                np.maximum(best, near, out=best)
            elif rows < values.shape[-2]:
                above, below = best[..., rows:, :], best[..., :-rows, :]
                np.maximum(above, near[..., :-rows, :], out=above)
                np.maximum(below, near[..., rows:, :], out=below)
        return best

    def paths(self, values: Real) -> Integers:
        """Return the cells (2, B, K) of the best flights from the first instant on.

        `values` (K, B, i, j) is what `backward` returns for each of B fields of rewards.
        """
        count, (width, height) = values.shape[1], values.shape[2:]
        signed = {(s * row, most) for row, most in self.rows for s in (1, -1)}
        step = np.array([(row, j) for row, most in signed for j in range(-most, most + 1)]).T
        cells = np.empty((2, count, len(values)), dtype=np.int_)
        cells[..., 0] = np.divmod(values[0].reshape(count, -1).argmax(axis=-1), height)
        each = np.arange(count)
        for k in range(1, len(values)):
            here = cells[:, :, k - 1]
            for after in reversed(self._stages(values[k])):
                i, j = here[..., None] + step[:, None]
                inside = (i >= 0) & (i < width) & (j >= 0) & (j < height)
                i, j = np.where(inside, i, 0), np.where(inside, j, 0)
                best = np.where(inside, after[each[:, None], i, j], -np.inf).argmax(axis=-1)
                here = np.stack([i[each, best], j[each, best]])
            cells[:, :, k] = here
        return cells


def largest_within(values: Real, reaches: Iterable[int]) -> dict[int, Real]:
    """Return for each of `reaches` the largest of `values` (..., n) up to so many places away.

    Windows that double serve all of them. scipy.ndimage has a filter for one reach, and takes
    0.15 s to import.

    >>> largest_within(np.array([3.0, 0.0, 1.0, 0.0]), [1])[1].tolist()
    [3.0, 3.0, 1.0, 1.0]
    """
    order = sorted(set(reaches))
    length, most = values.shape[-1], order[-1]
    edges = [(0, 0)] * (values.ndim - 1) + [(most, most)]
    largest, size = np.pad(values, edges, constant_values=-np.inf), 1
    found = {}
    for reach in order:
        width = 2 * reach + 1
        while 2 * size <= width:
            largest = np.maximum(largest[..., :-size], largest[..., size:])
            size *= 2
        first, last = most - reach, most + reach + 1 - size
        found[reach] = np.maximum(
            largest[..., first : first + length], largest[..., last : last + length]
        )
    return found


def sweep_over(
    kin: Kinematics,
    places: Real,
    *,
    cells: int,
    reach: float,
    most_instants: int,
    free: FreeArea | None = None,
    outward: bool = False,
) -> Sweep:
    """Return the cells and instants for flights of `kin` between `places` (k, 2), m.

    With `outward` no flight is missed: cells and steps are rounded outwards. The map is a box about
    the ends, all places and obstacles. A flight beyond it has a projection on it that is never
    farther from a place, keeps the limits used here, and meets no obstacle.

    Args:
        kin: the feasible set.
        places: the stations.
        cells: how many cells the map has at most, about.
        reach: how many cells one step reaches, about.
        most_instants: K is at most this.
        free: where the aircraft may be, everywhere if None.
        outward: whether no flight may be missed.
    """
    corners = np.vstack([kin.start, kin.end, places])
    since, until = kin.longest_ways()
    if free is not None:
        corners = np.vstack([corners, _edges(free, kin, float(since[-1]))])
    low, high = corners.min(axis=0), corners.max(axis=0)
    extent = np.maximum(high - low, _THINNEST * float((high - low).max()) + 1.0)
    duration = kin.time_step * (kin.slots - 1)
    side = max(
        float(np.sqrt(extent.prod() / cells)), kin.max_speed * duration / (reach * most_instants)
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
    blocks = np.array_split(inner, max(1, min(len(inner) // slots, most_instants)))
    instants = np.array([t[block].mean() for block in blocks])
    alive = np.ones((len(blocks), *x.shape[1:]), dtype=np.bool_)
    for end, ways in ((kin.start, since), (kin.end, until)):
        # the way is convex in time up to v_max and straight beyond: never above its chords
        way = np.interp(instants, t, ways) + CORNER * side
        alive &= np.hypot(*(x - end[:, None, None])) <= way[:, None, None]
    inside = np.ones(x.shape[1:], dtype=np.bool_)
    if free is not None:
        area = FreeArea(free.shape.buffer(CORNER * side)) if outward else free
        inside = area.covers(x.reshape(2, -1).T).reshape(x.shape[1:])
    step = kin.max_speed * float(np.diff(instants).max(initial=0.0))
    stages = 1 if free is None else max(1, round(reach / _FENCED_REACH))
    rows = _disc(step / side / stages, outward=outward)
    return Sweep(x, side, blocks, instants, alive & inside, rows, stages, inside)


def _edges(free: FreeArea, kin: Kinematics, reach: float) -> Real:
    """Return the corners (k, 2) of `free`, m, those beyond `reach` of the start drawn nearer."""
    import shapely

    rings = shapely.get_coordinates(free.shape)
    inner = rings[np.abs(rings).max(axis=1) < 0.99 * FARTHEST]
    return np.asarray(np.clip(inner, kin.start - reach, kin.start + reach))


def _disc(radius: float, *, outward: bool) -> list[tuple[int, int]]:
    """Return the rows and columns that a disc of `radius` cells reaches, centre to centre.

    With `outward` from any point of one cell to any point of another.
    """
    rows = []
    for row in range(int(radius) + 2):
        across = max(0, row - 1) if outward else row
        if across <= radius:
            along = int(np.sqrt(radius**2 - across**2))
            rows.append((row, along + 1 if outward else along))
    return rows
