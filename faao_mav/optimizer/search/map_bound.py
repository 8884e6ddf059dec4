"""An upper bound on every flight by prices on both hops, and dynamic programming over the map.

For prices p_n of what the relay receives, from 0 to 1, that never rise,

    sum_n f_n <= sum_n p_n I_U(w_n) + (1 - p_{n-1}) I_G(w_n)

is true of all that a queue delivers: a bit that leaves in slot n came in before it. In half duplex
a slot has the larger of the two terms. With one price lambda for all slots the right-hand side
bounds R_avg. The best flight for given prices, by position alone, is a `Sweep` that is rounded
outwards: whatever the prices, its value is above every flight. Prices that make it low come from
cutting planes: what the best flights so far have of both hops bounds it from below.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.search.sweep import CORNER, Sweep, sweep_over

_DIRECTIONS = 3
"""Velocities between 0 and v_max along each axis that a run of slots is flown at. Chosen: with 2
the bound of `copter_relay.yaml` is 0.1 % higher."""

_COARSE_CELLS, _COARSE_REACH = 500, 5.0
"""Cells of the map and reach of a step, in cells, where prices are searched. Chosen."""

FINE_CELLS, _FENCED_CELLS, _REACH = 30_000, 60_000, 9.0
"""The same for the bound. Measured on `copter_relay.yaml`: 2.0 % above the plan's R_avg with these,
2.4 % and 3.0 % with sides of 2 and 4 m and a single price. Beside a fence, on `fenced_relay.yaml`:
2.9 % with 60,000 cells, 3.3 % with 30,000."""

_MOST_INSTANTS = 100
"""Instants of a flight at most, which limits time and memory. Chosen."""

_CUTS = 16
"""Cutting planes. Measured on `copter_relay.yaml`: 8 are within 1e-4 of the limit, 16 of half
duplex."""

_TRUST = 0.3
"""By how much a price may change in the first cut; in cut i by 1 / i of that. Chosen."""

_ENOUGH = 1e-4
"""Bit/s/Hz between the bound and what the cuts show to be possible below which they end. Chosen."""

_DIGITS = 3
"""Decimals of the prices: at equal ones the worth of the cells is worked out once. Chosen."""

_APART = 0.01
"""By how much the prices of the bound lie apart: a place at which one of them is high has another
that is low. Chosen."""


@dataclass(frozen=True, slots=True, eq=False)
class RadialRates:
    """Upper bounds on the best rates of both links by the horizontal distance from the station.

    `values` (2, slots or 1, m) at distances of 0, `step`, 2 `step` ..., bits, falling.
    """

    step: float
    values: Real

    def at(self, link: int, slot: int, distance: Real) -> Real:
        """Return the rate of `link` in `slot` at `distance` (...), m, or any larger one."""
        row = self.values[link, slot if self.values.shape[1] > 1 else 0]
        grid = self.step * np.arange(len(row))
        return np.asarray(np.interp(distance.ravel(), grid, row).reshape(distance.shape))


def at_ends(problem: Problem, rates: RadialRates, price_first: float, price_last: float) -> float:
    """Return what the first and the last slot are worth at their prices, bits."""
    kin, links = problem.kinematics, problem.links
    (U_0, U_1), (G_0, G_1) = (
        [
            float(rates.at(j, slot, np.array([np.hypot(*(end - link.station))]))[0])
            for slot, end in ((0, kin.start), (-1, kin.end))
        ]
        for j, link in enumerate(links)
    )
    received, forwarded = price_first * U_0, (1 - price_last) * G_1
    if problem.maximised_queue is None:
        received, forwarded = received + price_last * U_1, forwarded + (1 - price_first) * G_0
    return received + forwarded


@dataclass(frozen=True)
class MapBound:
    """The sweep of a problem, and what its cells are worth at given prices."""

    problem: Problem
    rates: RadialRates
    sweep: Sweep

    @classmethod
    def over(cls, problem: Problem, rates: RadialRates, cells: int, reach: float) -> "MapBound":
        """Return the bound of `problem` over a map of so many cells, and steps of `reach` cells."""
        sweep = sweep_over(
            problem.kinematics,
            np.array([link.station for link in problem.links]),
            cells=cells,
            reach=reach,
            most_instants=_MOST_INSTANTS,
            free=problem.free_area,
            outward=True,
        )
        return cls(problem, rates, sweep)

    @property
    def _half(self) -> bool:
        queue = self.problem.maximised_queue
        return queue is not None and queue.half

    def received_and_forwarded(self, k: int) -> Real:
        """Return rates of both links (2, parts, velocities, i, j) in the run of slots k, bits.

        With known draws the velocities are one, which stands for all. The slots of a run are added
        up, to one part, unless they are shared (half duplex).
        """
        if self.rates.values.shape[1] > 1:
            return self._rates(k)
        length = len(self.sweep.blocks[k])
        if length not in self._at_any_instant:
            self._at_any_instant[length] = self._rates(k)
        return self._at_any_instant[length]

    @cached_property
    def _at_any_instant(self) -> dict[int, Real]:
        return {}

    def _rates(self, k: int) -> Real:
        kin, sweep = self.problem.kinematics, self.sweep
        most, known = kin.max_speed, self.rates.values.shape[1] > 1
        along = np.arange(-_DIRECTIONS, _DIRECTIONS + 1) * most / _DIRECTIONS
        velocities = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
        gap = most / _DIRECTIONS * CORNER
        velocities = velocities[np.hypot(*velocities.T) <= most + gap]
        velocities = velocities[len(velocities) // 2 :]  # a run backwards has the same rates
        if known or len(sweep.blocks[k]) == 1:
            velocities, gap = np.zeros((1, 2)), most
        slots = sweep.blocks[k]
        found = np.zeros((2, len(slots) if self._half else 1, len(velocities), *sweep.x.shape[1:]))
        for number, slot in enumerate(slots.tolist()):
            tau = slot * kin.time_step - float(sweep.instants[k])
            # how far w_n may be from where the cell's centre and the velocity would have it
            off = CORNER * sweep.side + gap * abs(tau) + kin.max_acceleration * tau**2 / 2
            for j, link in enumerate(self.problem.links):
                for i, v in enumerate(velocities):
                    place = (link.station - v * tau)[:, None, None]
                    away = np.maximum(0.0, np.hypot(*(sweep.x - place)) - off)
                    found[j, number if self._half else 0, i] += self.rates.at(j, slot, away)
        return found

    def rewards(self, prices: Real) -> Real:
        """Return what each cell is worth at each instant at `prices` (B, K), (K, B, i, j)."""
        alive = self.sweep.alive
        found = np.empty((alive.shape[0], len(prices), *alive.shape[1:]))
        known, worths = self.rates.values.shape[1] > 1, dict[tuple[int, float], Real]()
        for k, here in enumerate(alive):
            rates = self.received_and_forwarded(k)
            for b, p in enumerate(prices[:, k].tolist()):
                key = (k if known else len(self.sweep.blocks[k]), p)
                if key not in worths:
                    worths[key] = self._worth(p, rates).max(axis=0)
                found[k, b] = np.where(here, worths[key], -np.inf)
        return found

    def _worth(self, price: float, rates: Real) -> Real:
        received, forwarded = price * rates[0], (1 - price) * rates[1]
        both = np.maximum(received, forwarded) if self._half else received + forwarded
        return np.asarray(both.sum(axis=0))

    def _at_ends(self, price_first: float, price_last: float) -> float:
        return at_ends(self.problem, self.rates, price_first, price_last)

    def bound(self, prices: Real) -> float:
        """Return what no flight exceeds at the `prices` (B, K), bit/s/Hz.

        Through each cell at an instant a flight is worth no more than at any of the prices.
        """
        rewards = self.rewards(prices)
        ends = np.array([self._at_ends(p[0], p[-1]) for p in prices])
        through = self.sweep.through(rewards) + ends[:, None, None]
        best = through.min(axis=1).max(axis=(1, 2)).min()
        return float(best) / self.problem.kinematics.slots

    def best_prices(self) -> Real:
        """Return the prices (K,) of the lowest bound that cutting planes find."""
        from scipy.optimize import linprog

        n, instants = self.problem.kinematics.slots, len(self.sweep.instants)
        queue = self.problem.maximised_queue is not None
        # p = falls @ y, y >= 0: prices that never rise, or one for all instants
        falls = np.triu(np.ones((instants, instants))) if queue else np.ones((instants, 1))
        y = np.zeros(falls.shape[1])
        y[-1] = 0.5
        least, best, planes, levels = np.inf, y, [], []
        for cut in range(_CUTS):
            p = falls @ y
            values = self.sweep.backward(self.rewards(p[None]))
            cells = self.sweep.paths(values)[:, 0].T.tolist()
            value = float(values[0].max()) + self._at_ends(p[0], p[-1])
            if value < least:
                least, best = value, y
            slope = np.array([self._slope(k, float(p[k]), cell) for k, cell in enumerate(cells)])
            slope[0] += self._at_ends(1, 0) - self._at_ends(0, 0)
            slope[-1] += self._at_ends(0, 1) - self._at_ends(0, 0)
            # value + slope (p' - p) <= t for the best flight at p
            planes.append(np.append(slope @ falls, -1.0))
            levels.append(float(slope @ p) - value)
            change = _TRUST / (1 + cut)
            around, free = falls @ best, np.zeros((instants, 1))
            bands = np.vstack([np.hstack([falls, free]), np.hstack([-falls, free])])
            room = [np.minimum(1.0, around + change), -np.maximum(0.0, around - change)]
            found = linprog(
                np.append(np.zeros(len(y)), 1.0),
                A_ub=np.vstack([*planes, bands]),
                b_ub=np.concatenate([levels, *room]),
                bounds=[(0.0, 1.0)] * len(y) + [(None, None)],
            )
            if found.x is None or found.fun is None or least - found.fun < _ENOUGH * n:
                break
            y = np.asarray(found.x[:-1])
        return np.asarray(np.clip(np.round(falls @ best, _DIGITS), 0.0, 1.0))

    def _slope(self, k: int, price: float, cell: list[int]) -> float:
        """Return by how much the worth of `cell` at instant k rises with its price, bits."""
        here = self.received_and_forwarded(k)[..., cell[0], cell[1]]
        received, forwarded = here[:, :, int(self._worth(price, here).argmax())]
        if self._half:
            receives = price * received > (1 - price) * forwarded
            return float((received * receives).sum() - (forwarded * ~receives).sum())
        return float((received - forwarded).sum())


def map_bound(problem: Problem, rates: RadialRates, *, cells: int | None = None) -> float:
    """Return an upper bound on what `problem` maximises, bit/s/Hz, over all flights.

    `rates` are upper bounds on the best rates by distance. With more `cells` of the map the bound
    is tighter; it takes as many times longer.
    """
    if cells is None:
        cells = FINE_CELLS if problem.free_area is None else _FENCED_CELLS
    coarse = MapBound.over(problem, rates, _COARSE_CELLS, _COARSE_REACH)
    fine = MapBound.over(problem, rates, cells, _REACH)
    prices = coarse.best_prices()
    prices = prices[np.abs(fine.sweep.instants[:, None] - coarse.sweep.instants).argmin(axis=1)]
    apart = prices + np.array([[-_APART], [0.0], [_APART]])
    return fine.bound(np.clip(apart, 0.0, 1.0))
