"""Flights over maps of gains: dynamic programming over place and queue, then searches close by.

A map has edges, and what lies behind a ridge is no slope away. What is to be had from an instant
on, of the queue's level then, is known for each cell by what the cells in reach have of the level
that is left, between two levels in proportion: the best path by position alone, whatever the map.
Made a flight, it is improved in a tube about it, on the mean of the rates about each place: over
less and less of them. What counts is always the map as it is.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.design import design
from faao_mav.optimizer.interior.constraint import ALLOWED, W, every_excess
from faao_mav.optimizer.interior.limits import Disc
from faao_mav.optimizer.interior.maximize import (
    LocalOptimum,
    constraints_of,
    maximize,
    nearest_flight,
)
from faao_mav.optimizer.kinematics import LENGTH, Trajectory
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.rates.field import Blurred, RateField, rate_field
from faao_mav.optimizer.search.map_bound import places_about
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.optimizer.search.sweep import NOWHERE, Cells, cells_of, largest_ahead
from faao_mav.radio.gain import GainField
from faao_mav.radio.relay import RelayQueue

CELLS, _ROUGH_CELLS, _LEVELS, _REACH = (3_000, 5_000), 800, 30, 4.0
"""Cells of the map for each of the paths and for that of a rough flight, which takes a tenth of a
second, levels of the queue, and cells that a step reaches.
Measured on six sites with ridges: paths over cells of several sizes differ by up to 5 %."""

_BETWEEN = 0.4
"""Sides of a cell that a step may be longer than the speed allows: between centres of cells the
directions are few. Chosen: without it paths are up to 7 % worse, with more they cannot be flown."""

_NARROWING = ((1.0, 0.5), (1.0, 0.25), (0.5, 0.125))
"""Radius of the tube and spread of the places about, in sides of a cell, of search after search.
Measured on six sites with ridges: from 2 % below the path's own rate to 1 % above. Spreads in the
map itself, over its cells, end up to 20 % lower: they take from the lit side of an edge alone."""

_ROOMS = (2.0, 1.0, 0.5, 0.0)
"""Sides of a cell that a path keeps from obstacles: the first of which there is a flight. Chosen:
a flight cuts corners of its path by a cell or so, and may not find out of an obstacle again."""

_NEAR = 3.0
"""Sides of a cell from a path within which obstacles count for the flight nearest to it. Chosen."""

_SHARES = (0.0, 0.5, 1.0)
"""Shares of a step in which a half-duplex relay receives. Chosen."""

_LEAST = 1e-9
"""Bits of the queue's highest level at least: there are levels where nothing is received."""

_AGAIN, _MOST = 5e-3, 20
"""The gain, in shares of what there is, above which a search is made again from where it ended, and
how often at most: a flight that stops at bends has to move farther than a tube is wide. Chosen."""


class QueueSweep:
    """Best paths by place and level: `rates` (2, K, i, j) of both hops over `cells`, bits.

    They are those of all slots of an instant together; steps from each to the next `reach` so many
    sides of a cell, over cells `inside` (i, j). There are so many even `levels`, bits per hertz and
    slot; below 0, for R_avg without a `relay`, more has been sent than was received.
    """

    def __init__(
        self,
        cells: Cells,
        rates: Real,
        levels: int,
        relay: RelayQueue | None,
        time_step: float,
        inside: Flags,
        reach: float,
    ) -> None:
        self.cells, self.rates, self.inside, self.reach = cells, rates, inside, reach
        self.queued, self.half = relay is not None, relay is not None and relay.half
        come, gone = rates.max(axis=(2, 3)).sum(axis=1)
        most = come * gone / max(come + gone, _LEAST)  # what is received first and then sent
        most = max(_LEAST, min(most, np.inf if relay is None else relay.buffer / time_step))
        self.levels: Real = np.linspace(-most if relay is None else 0.0, most, levels)

    def path(self) -> Real:
        """Return the best path, the places (K, 2) at the instants, m."""
        ahead = [each.reshape(len(self.levels), -1) for each in self._backward()][::-1]
        level = np.zeros(1)
        places = [int(self._between(ahead[0], level).argmax())]
        for k, after in enumerate(ahead[1:]):
            here = places[-1]
            start = np.arange(self.inside.size).reshape(self.inside.shape) == here
            near = np.flatnonzero(largest_ahead(1.0 * start, self.inside, self.reach) > 0)
            rates = self.rates[:, k].reshape(2, -1)[:, here, None]
            found = [
                (sent + self._between(after[:, near], left), left)
                for sent, left in self._after(level, *rates)
            ]
            best, level = max(found, key=lambda each: float(each[0].max()))
            places.append(int(near[best.argmax()]))
        return np.asarray(self.cells.x.reshape(2, -1)[:, places].T)

    def _backward(self) -> Iterator[Real]:
        """Yield what can be sent (L, i, j), by the level before, from the last instant back."""
        shape = len(self.levels), *self.cells.x.shape[1:]
        after = np.broadcast_to(np.minimum(0.0, self.levels)[:, None, None], shape)
        for k in range(len(self.cells.instants) - 1, -1, -1):
            options = self._after(self.levels[:, None, None], *self.rates[:, k])
            best = np.max([sent + self._between(after, left) for sent, left in options], axis=0)
            found = np.where(self.cells.alive[k], best, NOWHERE)
            yield found
            after = largest_ahead(found, self.inside, self.reach)

    def _after(self, level: Real, I_U: Real, I_G: Real) -> Iterator[tuple[Real, Real]]:
        """Yield what is sent from a `level` on, and the level that is left."""
        for share in _SHARES if self.half else (None,):
            come, gone = (I_U, I_G) if share is None else (share * I_U, (1 - share) * I_G)
            sent = np.minimum(level + come, gone) if self.queued else gone + 0 * level
            yield sent, np.clip(level + come - sent, self.levels[0], self.levels[-1])

    def _between(self, values: Real, level: Real) -> Real:
        """Return the `values` (L, ...) at a `level` (..., or L, ...)."""
        at = (level - self.levels[0]) / (self.levels[1] - self.levels[0])
        low = np.minimum(at.astype(np.intp), len(self.levels) - 2)
        wide = low if low.ndim == values.ndim else low[None]
        below, above = (np.take_along_axis(values, wide + step, 0) for step in (0, 1))
        found = below + (at - low) * (above - below)
        return np.asarray(found if low.ndim == values.ndim else found[0])


def starts_over_map(
    problem: Problem, field: RateField, *, rough: bool = False
) -> dict[str, Trajectory]:
    """Return the best flights along paths over so many cells: `map`, `map 2` and on.

    A `rough` one is the first that is found.
    """
    found: dict[str, Trajectory] = {}
    for count in (_ROUGH_CELLS,) if rough else CELLS:
        flights = [*islice(flights_over_map(problem, field, count), 1 if rough else None)]
        if flights:
            best = max(flights, key=lambda flight: _worth(problem, field, flight))
            found[f"map {len(found) + 1}" if found else "map"] = best
    return found


def flights_over_map(problem: Problem, field: RateField, cells: int) -> Iterator[Trajectory]:
    """Yield flights that keep the fence along paths over so many `cells`.

    The farthest from obstacles come first.
    """
    kin, area, path = problem.kinematics, problem.free_area, np.empty((0, 2))
    limits = (*constraints_of(kin), *problem.fenced(kin))
    t = kin.time_step * np.arange(kin.slots)
    for room in (0.0,) if area is None else _ROOMS:
        sweep = queue_sweep(problem, field, cells, room)
        before, path = path, sweep.path()
        if np.array_equal(before, path):
            continue
        at = np.concatenate([[0.0], sweep.cells.instants, t[-1:]])
        places = np.vstack([kin.start, path, kin.end])
        along = np.stack([np.interp(t, at, each) for each in places.T], axis=1)
        about = problem.fenced(kin, (along, _NEAR * sweep.cells.side))
        flight = nearest_flight(kin, along, straight_flight(kin), about)
        if flight is not None and every_excess(kin, limits, flight) <= ALLOWED:
            yield flight


def queue_sweep(problem: Problem, field: RateField, cells: int, room: float = 0.0) -> QueueSweep:
    """Return the sweep of `problem` over about so many `cells`, by the rates of `field`.

    It keeps `room` sides of a cell from obstacles, but for the ends.

    Draws that are known for each slot do not count in it, nor does what follows a station: rates
    are those where it is at an instant.
    """
    kin, relay = problem.kinematics, problem.maximised_queue
    if any(link.nlos is not None and not link.averaged for link in problem.links):
        first, second = (replace(link, nlos=None) for link in problem.links)
        still = replace(problem, bs_uav=first, uav_user=second)
        field = rate_field(still, design(problem.plan, problem.precoder))
    places = places_about(problem)
    way = float(kin.longest_ways()[0][-1])
    reach = float(np.clip(way / (100 * _side(problem, cells)), _REACH, 2 * _REACH))
    found = cells_of(kin, places, cells, reach, problem.free_area)
    inside = np.ones(found.x.shape[1:], dtype=np.bool_)
    if problem.free_area is not None:
        x, ends = found.x.reshape(2, -1), np.stack([kin.start, kin.end])
        free = problem.free_area.inside(room * found.side).covers(x.T)
        near = np.hypot(*(x - ends[:, :, None]).swapaxes(0, 1)).min(axis=0) < 2 * found.side
        inside = (free | near & problem.free_area.covers(x.T)).reshape(inside.shape)
        found = replace(found, alive=found.alive & inside)
    moving = any(link.gains.station.ndim > 1 for link in problem.links)
    slots = [int(block[len(block) // 2]) for block in found.blocks] if moving else [0]
    fields = [field.over(GainField.in_slots, slot) for slot in slots]
    rates = np.stack([each.value(found.x[..., None])[..., 0] for each in fields], axis=1)
    counts = np.array([len(block) for block in found.blocks])
    return QueueSweep(
        found,
        counts[:, None, None] * rates,
        _LEVELS,
        relay,
        kin.time_step,
        inside,
        found.step + _BETWEEN,
    )


def improved_over_map(
    problem: Problem, field: RateField, start: Trajectory, iterations: int, *, rough: bool = False
) -> LocalOptimum:
    """Return the best of `start` and of what searches in tubes about it end in, by `field`.

    One that gains much is made again, unless it is to be `rough`.
    """
    kin, relay = problem.kinematics, problem.maximised_queue
    smooth, side = field.over(GainField.smoothed), _side(problem, CELLS[0])
    limits = (*constraints_of(kin), *problem.fenced(kin))

    now, worth = start, _worth(problem, field, start)
    best = LocalOptimum(start, worth, 0, np.inf, False)
    for radius, spread in _NARROWING[1:2] if rough else _NARROWING:
        for _ in range(1 if rough else _MOST):
            found = maximize(
                kin,
                Blurred(smooth, spread * side),
                now,
                constraints=(
                    *problem.fenced(kin, (now.w, radius * side)),
                    *problem.energy_limits(kin),
                    Disc(W, 1.0, now.w.T / LENGTH, unit=radius * side / LENGTH),
                ),
                tolerance=problem.plan.optimizer.tolerance,
                max_iterations=iterations,
                warm=True,
                relay=relay,
            )
            now, before = found.trajectory, worth
            worth = _worth(problem, field, now)
            # obstacles that count near the places of long slots are not all that chords meet
            if worth > best.value and every_excess(kin, limits, now) <= ALLOWED:
                best = replace(found, value=worth)
            if worth - before <= _AGAIN * before:
                break
    return best


def _worth(problem: Problem, field: RateField, flight: Trajectory) -> float:
    """Return what `problem` maximises, bit/s/Hz, along a `flight` by `field`."""
    return problem.value(field.value(flight.w.T))


def _side(problem: Problem, cells: int) -> float:
    """Return the side of so many `cells` over all that matters to the gains, m."""
    ends = problem.kinematics.start, problem.kinematics.end
    extent = np.ptp(np.vstack([places_about(problem), *ends]), axis=0)
    return max(1.0, float(np.sqrt(extent.prod() / cells)))
