"""An upper bound on every flight by a price on both hops, and dynamic programming over the map.

For prices p_n from 0 to 1 of what the relay receives, which never rise,

    sum_n f_n <= sum_n p_n I_U(w_n) + (1 - p_n) I_G(w_n)

is true of all that a queue delivers: a bit that leaves came in before it. Of R_avg it is true of
one price, which may differ by the place half-way. In half duplex a slot has the larger of the two
terms. The best flight, by position alone, is a sweep over the `Cells` of a map, in which the price
falls wherever and whenever that makes what is still to come worth less: so what one flight takes
in, no other one can forward, unless both are at one place at one time. Whatever the prices, the
sweep's value is above every flight.
"""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.search.best_rates import BestRates
from faao_mav.optimizer.search.sweep import CORNER, cells_of, disc, largest_near
from faao_mav.radio.gain import PER_DB, GainField
from faao_mav.radio.gain_map import Grid

_DIRECTIONS = 5
"""Velocities between 0 and v_max along each axis that a run of slots is flown at. Chosen."""

_COARSE_CELLS, _CELLS, _MAPPED_CELLS, _OWN_CELLS = 500, 60_000, 150_000, 20_000
"""Cells of the map where the price is sought, of the bound, of it over maps of gains, and of it
where every slot has rates of its own. Measured on a site with ridges: 9.8 % above the plan with
60,000, 8.0 % with 120,000 and 7.6 % with 150,000, in two and a half times the time."""

_REACH = 10.0
"""Cells that a step reaches, about. Measured on two sites with ridges: with 12 the
bound is 0.2 and 0.4 % higher."""

_APART = np.array([0.02, 0.06, 0.11, 0.18, 0.27, 0.36, 0.47])
"""Prices of the bound to both sides of the one that alone bounds best. Measured on the same site:
2.5 % tighter than five that end at 0.4."""

PARTS = 2
"""Points to the side of a cell at which rates are tabulated. Chosen."""

_NEARER = 0.25
"""Sides of a cell to which the way that a table's rates are rounded outwards is rounded up.
Chosen."""


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
    """Return the price of the lowest `bound`, which is convex in it, to 0.01."""
    from scipy.optimize import minimize_scalar

    found = minimize_scalar(
        lambda price: bound([price]), bounds=(0.0, 1.0), method="bounded", options={"xatol": 0.01}
    )
    return float(found.x)


class MapBound:
    """About so many `cells` of a map for a problem, and what they are worth at prices."""

    def __init__(self, problem: Problem, rates: BestRates, cells: int) -> None:
        self.problem, self.rates, kin = problem, rates, problem.kinematics
        self.cells = cells_of(kin, places_about(problem), cells, _REACH, problem.free_area)
        self.own, relay = own_rates(problem, rates), problem.maximised_queue
        self._half = relay is not None and relay.half

    def bound(self, prices: Sequence[float]) -> float:
        """Return what no flight exceeds at the `prices` (B,), bit/s/Hz.

        R_avg has one price for a whole flight, by the cell that it is in half-way.
        """
        p, blocks = np.unique(np.clip(prices, 0.0, 1.0)), self.cells.blocks
        queue = self.problem.maximised_queue
        first, last = (at_ends(self.problem, self.rates, price) for price in (1.0, 0.0))
        of_length = {len(block): k for k, block in enumerate(blocks)}
        shared = {} if self.own else {n: self._of_run(k, p) for n, k in of_length.items()}

        def worth(k: int) -> Real:
            found = shared[len(blocks[k])] if shared else self._of_run(k, p)
            return np.where(self.cells.alive[k], found, -np.inf)

        def swept(runs: Iterable[int], end: Real) -> Real:
            best, rows = end[:, None, None], disc(self.cells.step)
            for k in runs:
                best = worth(k) + best
                if queue is not None:
                    best = np.minimum.accumulate(best, axis=0)
                best = largest_near(best, rows)
            return best

        runs = range(len(blocks))
        middle = len(blocks) // 2 if queue is None else 0
        before, after = swept(runs[:middle], p * first), swept(runs[:middle:-1], (1 - p) * last)
        through = (before + worth(middle) + after).min(axis=0)
        return float(through.max()) / self.problem.kinematics.slots

    def _of_run(self, k: int, p: Real) -> Real:
        """Return what run `k` of slots is worth in each cell at prices `p` (B,), (B, i, j), bits.

        It is flown at one of a few velocities, and rates are rounded outwards to all between them.
        """
        kin, cells = self.problem.kinematics, self.cells
        slots = cells.blocks[k]
        tau = slots * kin.time_step - float(cells.instants[k])
        velocities, gap = self._velocities(slots)
        parts = 1 if len(velocities) == 1 else PARTS
        side = cells.side / parts
        shifts = np.rint(tau[:, None, None] * velocities / side).astype(np.intp)
        margin = int(np.abs(shifts).max())
        rows, columns = cells.x.shape[1:]
        axes = [
            first + side * np.arange(-margin, parts * (count - 1) + margin + 1)
            for first, count in zip(cells.x[:, 0, 0], (rows, columns), strict=True)
        ]
        # how far w_n may be from where the cell's centre and the velocity would have it
        off = CORNER * (cells.side + side * (parts > 1)) + gap * np.abs(tau)
        off += kin.max_acceleration * tau**2 / 2
        levels = np.ceil(off / (_NEARER * cells.side)).astype(int).tolist()
        own = slots.tolist() if self.own else [0] * len(slots)
        keys = list(zip(levels, own, strict=True))
        tables = {key: self._table(*key, axes, p) for key in set(keys)}
        best = np.full((len(p), rows, columns), -np.inf)
        for v in range(len(velocities)):
            worth = np.zeros((len(p) if self._half else 2, rows, columns))
            for key, (row, column) in zip(keys, (margin + shifts[:, v]).tolist(), strict=True):
                worth += tables[key][:, row::parts, column::parts][:, :rows, :columns]
            for price, each in enumerate(p.tolist()):
                here = worth[price] if self._half else each * worth[0] + (1 - each) * worth[1]
                np.maximum(best[price], here, out=best[price])
        return best

    def _table(self, level: int, slot: int, axes: Sequence[Real], p: Real) -> Real:
        """Return the most rates (2, i, j) of both links about the points of `axes`, bits.

        About them is within `level` times `_NEARER` sides of a cell. In half duplex it is what the
        `slot` is worth at the prices `p` (B,), (B, i, j).
        """
        off = level * _NEARER * self.cells.side
        U, G = (
            self.rates.at(j, slot, most_gain(link.gains.in_slots(slot), axes, off))
            for j, link in enumerate(self.problem.links)
        )
        price = p[:, None, None]
        return np.maximum(price * U, (1 - price) * G) if self._half else np.stack([U, G])

    def _velocities(self, slots: Integers) -> tuple[Real, float]:
        """Return the velocities (V, 2) of a run of `slots`, and how far others are off them, m/s.

        With known draws one stands for all.
        """
        most = self.problem.kinematics.max_speed
        if self.rates.known or len(slots) == 1:
            return np.zeros((1, 2)), most
        along = np.arange(-_DIRECTIONS, _DIRECTIONS + 1) * most / _DIRECTIONS
        gap = most / _DIRECTIONS * CORNER
        velocities = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
        velocities = velocities[np.hypot(*velocities.T) <= most + gap]
        # a run backwards has the same rates, unless a station moves
        return (velocities if self.own else velocities[len(velocities) // 2 :]), gap


def own_rates(problem: Problem, rates: BestRates) -> bool:
    """Return whether every slot has rates of its own: by known draws, or by stations that move."""
    return rates.known or any(link.gains.station.ndim > 1 for link in problem.links)


def places_about(problem: Problem) -> Real:
    """Return places (k, 2), m: beyond a box about them and the ends all gains only fall outwards.

    They are the stations, as far about them as the gain by its law rises with the distance, and the
    corners of maps; what no flight can reach of them is drawn nearer.
    """
    kin, places = problem.kinematics, list[Real]()
    apart, way = np.abs(kin.end - kin.start), float(kin.longest_ways()[0][-1])
    half = np.sqrt(np.maximum(0.0, way**2 - apart[::-1] ** 2)) / 2
    middle = (kin.start + kin.end) / 2
    for link in problem.links:
        field, found = link.gains, link.gains.station.reshape(-1, 2)
        turns = field.law.turns(problem.farthest(link), field.height)
        gains = field.most_between(turns, turns)
        rising = turns[-1] if gains[-1] > gains[-2] else turns[-2]
        if rising > 0:
            found = np.concatenate([found - rising, found + rising])
        if isinstance(field.above, Grid):
            corners = np.array([[side[0], side[-1]] for side in (field.above.x, field.above.y)])
            found = np.concatenate([found, corners.T])
        if isinstance(field.above, Grid) or rising > 0:
            found = np.clip(found, middle - half, middle + half)
        places.append(found)
    return np.vstack(places)


def most_gain(field: GainField, axes: Sequence[Real], off: float) -> Real:
    """Return upper bounds (i, j) on l within `off` m of the places of an even grid, m.

    That is the most by the law and the most of the map within so far. The `axes` are x (i,) and
    y (j,); the station is at rest.
    """
    x, y = axes
    distance = np.hypot(x[:, None] - field.station[0], y - field.station[1])
    most = field.most_between(np.maximum(0.0, distance - off), distance + off)
    if field.above is None:
        return most
    assert isinstance(field.above, Grid)
    side = float(x[1] - x[0])
    rows = disc(off / side, 0.5)
    margin = rows[-1][0]
    edges = [each[0] + side * (np.arange(-margin, len(each) + margin + 1) - 0.5) for each in (x, y)]
    within = largest_near(field.above.most_between(*edges), rows)
    inner = (slice(margin, margin + len(each)) for each in axes)
    return np.asarray(most + PER_DB * within[*inner])


def map_bound(problem: Problem, rates: BestRates, *, cells: int | None = None) -> float:
    """Return an upper bound on what `problem` maximises, bit/s/Hz, over all flights.

    `rates` are upper bounds on the best rates. With more `cells` of the map the bound
    is tighter; it takes as many times longer.
    """
    if cells is None:
        own = own_rates(problem, rates)
        cells = _OWN_CELLS if own else _MAPPED_CELLS if problem.mapped else _CELLS
    price = best_price(MapBound(problem, rates, _COARSE_CELLS).bound)
    prices = [*(price - _APART), price, *(price + _APART)]
    return MapBound(problem, rates, cells).bound(prices)
