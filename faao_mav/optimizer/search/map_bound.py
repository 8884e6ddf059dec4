"""An upper bound on every flight by a price on both hops, and dynamic programming over the map.

For a price p from 0 to 1 of what the relay receives,

    sum_n f_n <= sum_n p I_U(w_n) + (1 - p) I_G(w_n)

is true of all that a queue delivers, and of R_avg: a bit that leaves came in before it. In half
duplex a slot has the larger of the two terms. The best flight at a price, by position alone, is a
sweep over the `Cells` of a map: whatever the price, its value is above every flight.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.search.sweep import CORNER, Cells, cells_of

_DIRECTIONS = 3
"""Velocities between 0 and v_max along each axis that a run of slots is flown at. Chosen: with 2
the bound of `copter_relay.yaml` is 0.1 % higher."""

_COARSE_CELLS, _FINE_CELLS, _FENCED_CELLS = 500, 30_000, 60_000
"""Cells of the map where the price is sought, and of the bound. Measured: `copter_relay.yaml` 2.4 %
above the plan's R_del with 30,000; `fenced_relay.yaml` 3.3 % with 30,000 and 2.9 % with 60,000."""

_COARSE_REACH, _REACH = 5.0, 9.0
"""Cells that a step reaches in either map, about. Chosen."""

_APART = (-0.01, 0.0, 0.01)
"""Prices of the bound beside the best one: a place at which one of them is high has another that is
low. Chosen."""

_GOLDEN, _SECTIONS = (5**0.5 - 1) / 2, 9
"""Golden section of the price, and how often: it is found to 0.01. Chosen."""


@dataclass(frozen=True, slots=True, eq=False)
class RadialRates:
    """Upper bounds on the best rates of both links by the horizontal distance from the station.

    `values` (2, slots or 1, m) at distances of 0, `step`, 2 `step` ..., bits.
    """

    step: float
    values: Real

    def at(self, link: int, slot: int, distance: Real, beyond: float = math.inf) -> Real:
        """Return the most of `link` in `slot` from `distance` (...), m, to so much `beyond` it."""
        from scipy.ndimage import maximum_filter1d  # with the bounds, not before

        row = self.values[link, slot if self.values.shape[1] > 1 else 0]
        size = 2 + math.ceil(min(beyond / self.step, len(row)))
        row = maximum_filter1d(row, size, origin=-(size // 2), mode="nearest")
        grid = self.step * np.arange(len(row))
        return np.asarray(np.interp(distance.ravel(), grid, row).reshape(distance.shape))


def at_ends(problem: Problem, rates: RadialRates, price: float) -> float:
    """Return what the first and the last slot are worth at a `price`, bits."""
    kin, links = problem.kinematics, problem.links
    (U_0, U_1), (G_0, G_1) = (
        [
            float(rates.at(j, slot, np.array([np.hypot(*(end - link.gains.station))]), 0.0)[0])
            for slot, end in ((0, kin.start), (-1, kin.end))
        ]
        for j, link in enumerate(links)
    )
    if problem.maximised_queue is None:
        return price * (U_0 + U_1) + (1 - price) * (G_0 + G_1)
    return price * U_0 + (1 - price) * G_1


def best_price(bound: Callable[[list[float]], float]) -> float:
    """Return the price of the lowest `bound`, which is convex in it, by golden section."""
    low, high = 0.0, 1.0
    inner = [1 - _GOLDEN, _GOLDEN]
    values = [bound([price]) for price in inner]
    for _ in range(_SECTIONS):
        left = int(values[0] <= values[1])  # which of both stays inside
        low, high = (low, inner[1]) if left else (inner[0], high)
        kept, worth = inner[1 - left], values[1 - left]
        price = low + high - kept
        pairs = sorted([(kept, worth), (price, bound([price]))])
        inner, values = [each for each, _ in pairs], [each for _, each in pairs]
    return inner[int(values[1] < values[0])]


@dataclass(frozen=True)
class MapBound:
    """The cells of a problem, and what they are worth at a price."""

    problem: Problem
    rates: RadialRates
    cells: Cells

    @classmethod
    def over(cls, problem: Problem, rates: RadialRates, cells: int, reach: float) -> "MapBound":
        """Return the bound of `problem` over about so many cells, and steps of `reach` cells."""
        stations = np.array([link.gains.station for link in problem.links])
        kin, free = problem.kinematics, problem.free_area
        return cls(problem, rates, cells_of(kin, stations, cells, reach, free))

    @cached_property
    def _rates(self) -> dict[int, Real]:
        """Rates of both links (2, parts, velocities, i, j) in runs of slots, bits.

        By the number of the run with known draws, else by its length. With known draws the
        velocities are one, which stands for all. The slots of a run are added up, to one part,
        unless they are shared (half duplex).
        """
        known = self.rates.values.shape[1] > 1
        runs = enumerate(self.cells.blocks)
        found = {(k if known else len(run)): k for k, run in runs}
        return {key: self._of_run(k, known=known) for key, k in found.items()}

    def _of_run(self, k: int, *, known: bool) -> Real:
        kin, cells = self.problem.kinematics, self.cells
        most, slots = kin.max_speed, cells.blocks[k]
        along = np.arange(-_DIRECTIONS, _DIRECTIONS + 1) * most / _DIRECTIONS
        velocities = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
        gap = most / _DIRECTIONS * CORNER
        velocities = velocities[np.hypot(*velocities.T) <= most + gap]
        velocities = velocities[len(velocities) // 2 :]  # a run backwards has the same rates
        if known or len(slots) == 1:
            velocities, gap = np.zeros((1, 2)), most
        parts = len(slots) if self._half else 1
        found = np.zeros((2, parts, len(velocities), *cells.x.shape[1:]))
        for number, slot in enumerate(slots.tolist()):
            tau = slot * kin.time_step - float(cells.instants[k])
            # how far w_n may be from where the cell's centre and the velocity would have it
            off = CORNER * cells.side + gap * abs(tau) + kin.max_acceleration * tau**2 / 2
            for j, link in enumerate(self.problem.links):
                for i, v in enumerate(velocities):
                    place = (link.gains.station - v * tau)[:, None, None]
                    away = np.maximum(0.0, np.hypot(*(cells.x - place)) - off)
                    found[j, number % parts, i] += self.rates.at(j, slot, away, 2 * off)
        return found

    @property
    def _half(self) -> bool:
        queue = self.problem.maximised_queue
        return queue is not None and queue.half

    def bound(self, prices: Sequence[float]) -> float:
        """Return what no flight exceeds at the `prices` (B,), bit/s/Hz.

        Through each cell at an instant a flight is worth no more than at any of the prices.
        """
        known = self.rates.values.shape[1] > 1
        p = np.clip(np.array(prices), 0.0, 1.0)[:, None, None, None, None]
        worth = {}
        for key, (received, forwarded) in self._rates.items():
            both = p * received, (1 - p) * forwarded
            total = np.maximum(*both) if self._half else both[0] + both[1]
            worth[key] = total.sum(axis=1).max(axis=1)
        runs = self.cells.blocks
        rewards = np.stack([worth[k if known else len(run)] for k, run in enumerate(runs)])
        rewards = np.where(self.cells.alive[:, None], rewards, -np.inf)
        ends = np.array([at_ends(self.problem, self.rates, price) for price in p.ravel().tolist()])
        through = self.cells.through(rewards) + ends[:, None, None]
        best = through.min(axis=1).max(axis=(1, 2)).min()
        return float(best) / self.problem.kinematics.slots


def map_bound(problem: Problem, rates: RadialRates, *, cells: int | None = None) -> float:
    """Return an upper bound on what `problem` maximises, bit/s/Hz, over all flights.

    `rates` are upper bounds on the best rates by distance. With more `cells` of the map the bound
    is tighter; it takes as many times longer.
    """
    if cells is None:
        cells = _FINE_CELLS if problem.free_area is None else _FENCED_CELLS
    price = best_price(MapBound.over(problem, rates, _COARSE_CELLS, _COARSE_REACH).bound)
    return MapBound.over(problem, rates, cells, _REACH).bound([price + off for off in _APART])
