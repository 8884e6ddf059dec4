"""An upper bound on every flight by a price on both hops, and dynamic programming over the map.

For a price p from 0 to 1 of what the relay receives,

    sum_n f_n <= sum_n p I_U(w_n) + (1 - p) I_G(w_n)

is true of all that a queue delivers, and of R_avg: a bit that leaves came in before it. In half
duplex a slot has the larger of the two terms. The best flight at a price, by position alone, is a
sweep over the `Cells` of a map: whatever the price, its value is above every flight.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.problem import Link, Problem
from faao_mav.optimizer.search.best_rates import BestRates
from faao_mav.optimizer.search.sweep import CORNER, Cells, cells_of, disc, largest_near
from faao_mav.radio.gain import PER_DB, GainField
from faao_mav.radio.gain_map import Grid

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

_PARTS, _MOST_PARTS = 3, 1_000_000
"""Parts of the radius of a disc over which the most of a map is found, by boxes of that side, and
how many boxes there are at most. Chosen."""

_GOLDEN, _SECTIONS = (5**0.5 - 1) / 2, 9
"""Golden section of the price, and how often: it is found to 0.01. Chosen."""


def at_ends(problem: Problem, rates: BestRates, price: float) -> float:
    """Return what the first and the last slot are worth at a `price`, bits."""
    kin, links = problem.kinematics, problem.links
    (U_0, U_1), (G_0, G_1) = (
        [
            float(rates.at(j, slot, link.gains.in_slots(slot).log(end[:, None]))[0])
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
    rates: BestRates
    cells: Cells

    @classmethod
    def over(cls, problem: Problem, rates: BestRates, cells: int, reach: float) -> "MapBound":
        """Return the bound of `problem` over about so many cells, and steps of `reach` cells."""
        places = np.vstack([places_about(problem, link) for link in problem.links])
        kin, free = problem.kinematics, problem.free_area
        return cls(problem, rates, cells_of(kin, places, cells, reach, free))

    @cached_property
    def _rates(self) -> dict[int, Real]:
        """Rates of both links (2, parts, velocities, i, j) in runs of slots, bits.

        By their `_keys`. With known draws the velocities are one, which stands for all. The slots
        of a run are added up, to one part, unless they are shared (half duplex).
        """
        return {key: self._of_run(self._keys.index(key)) for key in set(self._keys)}

    @cached_property
    def _keys(self) -> list[int]:
        """Numbers of the runs, the same for those that have the same rates."""
        moves = any(link.gains.station.ndim > 1 for link in self.problem.links)
        own = moves or self.rates.known
        return [k if own else len(run) for k, run in enumerate(self.cells.blocks)]

    def _of_run(self, k: int) -> Real:
        known, moves = self.rates.known, len(set(self._keys)) == len(self._keys)
        kin, cells = self.problem.kinematics, self.cells
        most, slots = kin.max_speed, cells.blocks[k]
        along = np.arange(-_DIRECTIONS, _DIRECTIONS + 1) * most / _DIRECTIONS
        velocities = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
        gap = most / _DIRECTIONS * CORNER
        velocities = velocities[np.hypot(*velocities.T) <= most + gap]
        if not moves:  # a run backwards has the same rates
            velocities = velocities[len(velocities) // 2 :]
        if known or len(slots) == 1:
            velocities, gap = np.zeros((1, 2)), most
        parts = len(slots) if self._half else 1
        found = np.zeros((2, parts, len(velocities), *cells.x.shape[1:]))
        for number, slot in enumerate(slots.tolist()):
            tau = slot * kin.time_step - float(cells.instants[k])
            # how far w_n may be from where the cell's centre and the velocity would have it
            off = CORNER * cells.side + gap * abs(tau) + kin.max_acceleration * tau**2 / 2
            places = cells.x[:, None] + tau * velocities.T[:, :, None, None]
            for j, link in enumerate(self.problem.links):
                gain = most_gain(link.gains.in_slots(slot), places, off)
                found[j, number % parts] += self.rates.at(j, slot, gain)
        return found

    @property
    def _half(self) -> bool:
        queue = self.problem.maximised_queue
        return queue is not None and queue.half

    def bound(self, prices: Sequence[float]) -> float:
        """Return what no flight exceeds at the `prices` (B,), bit/s/Hz.

        Through each cell at an instant a flight is worth no more than at any of the prices.
        """
        p = np.clip(np.array(prices), 0.0, 1.0)[:, None, None, None, None]
        worth = {}
        for key, (received, forwarded) in self._rates.items():
            both = p * received, (1 - p) * forwarded
            total = np.maximum(*both) if self._half else both[0] + both[1]
            worth[key] = total.sum(axis=1).max(axis=1)
        rewards = np.stack([worth[key] for key in self._keys])
        rewards = np.where(self.cells.alive[:, None], rewards, -np.inf)
        ends = np.array([at_ends(self.problem, self.rates, price) for price in p.ravel().tolist()])
        through = self.cells.through(rewards) + ends[:, None, None]
        best = through.min(axis=1).max(axis=(1, 2)).min()
        return float(best) / self.problem.kinematics.slots


def places_about(problem: Problem, link: Link) -> Real:
    """Return places (k, 2), m: beyond a box about them and the ends the gain only falls outwards.

    They are the station, as far about it as the gain by its law rises with the distance, and the
    corners of a map; what no flight can reach of them is drawn nearer.
    """
    kin, field = problem.kinematics, link.gains
    turns = field.law.turns(problem.farthest(link), field.height)
    gains = field.most_between(turns, turns)
    rising = turns[-1] if gains[-1] > gains[-2] else turns[-2]
    found = field.station.reshape(-1, 2)
    if rising > 0:
        found = np.concatenate([found - rising, found + rising])
    if isinstance(field.above, Grid):
        corners = np.array([[side[0], side[-1]] for side in (field.above.x, field.above.y)])
        found = np.concatenate([found, corners.T])
    elif rising == 0:
        return found
    apart, way = np.abs(kin.end - kin.start), float(kin.longest_ways()[0][-1])
    middle, half = (
        (kin.start + kin.end) / 2,
        np.sqrt(np.maximum(0.0, way**2 - apart[::-1] ** 2)) / 2,
    )
    return np.asarray(np.clip(found, middle - half, middle + half))


def most_gain(field: GainField, w: Real, off: float) -> Real:
    """Return upper bounds on l within `off` m, above 0, of places w (2, ...), of a station at rest.

    That is the most by the law and the most of the map within so far.
    """
    distance = np.hypot(*field.away(w))
    most = field.most_between(np.maximum(0.0, distance - off), distance + off)
    if field.above is None:
        return most
    low, high = (each(w.reshape(2, -1), axis=1) for each in (np.min, np.max))
    side = max(off / _PARTS, float(np.sqrt(np.prod(high - low + 2 * off) / _MOST_PARTS)))
    rows = disc(off / side)
    margin = rows[-1][0] + 1
    edges = [
        first + side * np.arange(-margin, int((last - first) / side) + margin + 2)
        for first, last in zip(low, high, strict=True)
    ]
    assert isinstance(field.above, Grid)
    within = largest_near(field.above.most_between(*edges), rows)
    i, j = (((x - first) / side).astype(np.intp) + margin for x, first in zip(w, low, strict=True))
    return np.asarray(most + PER_DB * within[i, j])


def map_bound(problem: Problem, rates: BestRates, *, cells: int | None = None) -> float:
    """Return an upper bound on what `problem` maximises, bit/s/Hz, over all flights.

    `rates` are upper bounds on the best rates. With more `cells` of the map the bound
    is tighter; it takes as many times longer.
    """
    if cells is None:
        finer = problem.mapped or problem.free_area is not None
        cells = _FENCED_CELLS if finer else _FINE_CELLS
    price = best_price(MapBound.over(problem, rates, _COARSE_CELLS, _COARSE_REACH).bound)
    return MapBound.over(problem, rates, cells, _REACH).bound([price + off for off in _APART])
