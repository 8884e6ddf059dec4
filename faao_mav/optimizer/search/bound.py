"""An estimated upper bound on what a plan maximises, over all flights and precoders.

It is no proof: the best rates over the gain, on which it rests, are tabulated to about 1e-6 bit,
and precoders without a closed form are those of a local search. Given these rates, each of two
bounds holds for every flight; which are computed is said by the plan. `map_bound` knows the queue,
half duplex and fences, maps of gains and stations that move, and flights by their greatest speed
alone. `AxisBound` knows accelerations along the line through the stations, for aircraft that these
limit; it is for gains by the distance from stations at rest.

Along that line a flight is a motion with |v| <= v_max and |a| <= a_max, and dynamic programming
over cells of place and speed knows these limits. Across the line the flight is, in every slot, as
near as the way from its start and the way to its end let it be. Cells, steps and rates are rounded
outwards, so that no flight is missed: whatever the price lambda from 0 to 1 of what the relay
receives, no flight exceeds the largest sum of lambda I_U + (1 - lambda) I_G.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.search.best_rates import BestRates, best_rates
from faao_mav.optimizer.search.map_bound import at_ends, best_price, map_bound
from faao_mav.optimizer.search.sweep import largest_within
from faao_mav.optimizer.solution import Observer, Progress

_TIGHT = 0.03
"""How far above the known plan, as a share of it, a bound may be without another being tried.
Chosen."""

_BEYOND = 40.0
"""How far the axis goes beyond stations and ends, m; farther out counts as there. Chosen."""

_INTERVAL, _MOST_INSTANTS = 2.4, 50
"""Time between instants, s, at least, and instants of a flight at most. Chosen."""

_MOST_CELLS = 100_000
"""Cells at an instant at most, about: where a_max is small the instants lie farther apart. Chosen:
it limits time and memory."""

_PARTS = 4
"""Places to the side of a cell at which rates are tabulated. Chosen."""

_APART = (-0.05, -0.01, 0.01, 0.05)
"""Prices of the bound beside that of the lowest bound in coarse cells. Several part the flights by
where they are half-way: those near one station are worth less where the other is priced. Measured
on `paper_active.yaml` at 10 dBm: the outer ones serve T = 50 s, the inner ones T = 150 s."""

_COARSE, _FINE = 6, 12
"""Cells of the speed that a_max crosses between instants: for the price, and the bound. Chosen."""


@dataclass(frozen=True, slots=True)
class Bound:
    """The estimate of an upper bound on the rate that a plan maximises: `value`, bit/s/Hz.

    `exact` tells that the best precoders have a closed form; otherwise they are searched.
    """

    value: float
    exact: bool


def upper_bound(problem: Problem, known: float = 0.0, *, observe: Observer | None = None) -> Bound:
    """Estimate an upper bound on what `problem` maximises over all trajectories and precoders.

    That is the delivered rate, or with `radio.causal: false` R_avg. `known` is that rate of any
    plan for it, bit/s/Hz: the better it is, the tighter the bound. `observe` is told the progress.

    >>> from faao_mav import optimize, read_plan
    >>> solution = optimize(read_plan("missions/copter_relay.yaml"))
    >>> 1.0 < upper_bound(solution.problem).value / solution.delivered_rate < 1.1
    True
    """

    def tell(number: int, stage: str, best: float) -> None:
        if observe is not None:
            observe(Progress(number, 2, stage, best))

    tell(0, "the best rates", known)
    rates = best_rates(problem)
    relay, kin = problem.maximised_queue, problem.kinematics
    half = relay is not None and relay.half
    value = min(link.most for link in problem.links)
    if value > (1 + _TIGHT) * known:
        fields = [link.gains for link in problem.links]
        corners = np.vstack([kin.start, kin.end, *(field.station for field in fields)])
        extent = float(np.ptp(corners, axis=0).max())
        # there is no way from rest to v_max and back to rest
        accelerating = kin.max_speed**2 / kin.max_acceleration > extent
        radial = all(field.above is None and field.station.ndim == 1 for field in fields)
        if accelerating and not half and radial:
            tell(1, "the bound by the axis", value)
            value = min(value, axis_bound(problem, rates))
        # the axis takes the most of all larger distances: with a gain that rises there, too much
        other = any(not field.law.square for field in fields)
        if not accelerating or half or problem.free_area is not None or other or not radial:
            tell(1, "the bound over the map", value)
            value = min(value, map_bound(problem, rates))
        value = max(known, value)
    tell(2, "the bound", value)
    return Bound(value, rates.exact)


def axis_bound(problem: Problem, rates: BestRates) -> float:
    """Return an upper bound on R_avg of all flights by `AxisBound`, bit/s/Hz, full duplex only."""
    price = best_price(AxisBound(problem, rates, _COARSE).bound)
    return AxisBound(problem, rates, _FINE).bound([price + apart for apart in _APART])


class AxisBound:
    """Cells of place and speed along the axis through the stations, at K instants of a flight.

    a_max crosses `speeds` cells of the speed between two instants, which are h seconds apart:
    `instants` (K,), s, each for the slots of one of the `blocks`. Row i of the cells is at the
    place `x` (rows,), `side` m wide, column j at the speed `columns`[j] `gap`, from -v_max to
    v_max. With `side` = `gap` h / 2 a step from column i to column j goes i + j rows, and as far to
    either side as the acceleration lets it. The first and the last row stand for all places beyond.
    """

    def __init__(self, problem: Problem, rates: BestRates, speeds: int) -> None:
        self.problem, self.rates = problem, rates
        kin, (first, second) = problem.kinematics, (link.gains.station for link in problem.links)
        apart = float(np.hypot(*(second - first)))
        self.axis = (second - first) / apart if apart > 0 else np.array([1.0, 0.0])
        # start, end and both stations along and across the axis, m
        places = np.array([kin.start, kin.end, first, second]) - first
        self.along = places @ self.axis
        low, high = self.along.min() - _BEYOND, self.along.max() + _BEYOND

        inner = np.arange(1, kin.slots - 1)
        lasting = kin.time_step * len(inner)
        crossed = 4 * speeds**2 * kin.max_speed * (high - low) / kin.max_acceleration**2
        least = max(_INTERVAL, (crossed / _MOST_CELLS) ** (1 / 3))
        count = max(1, min(int(lasting / least), _MOST_INSTANTS, len(inner)))
        self.h = lasting / count
        self.instants = kin.time_step / 2 + self.h * (np.arange(float(count)) + 0.5)
        nearest = np.abs(self.instants[:, None] - kin.time_step * inner).argmin(axis=0)
        self.blocks = [inner[nearest == k] for k in range(count)]

        self.gap = kin.max_acceleration * self.h / speeds  # m/s
        self.side = self.gap * self.h / 2
        most = int(np.ceil(kin.max_speed / self.gap))
        self.columns = np.arange(-most, most + 1)
        self.x = low + self.side * np.arange(int((high - low) / self.side) + 2)
        # the least distance from the axis that each slot can have (n,), m
        ways = np.array(kin.longest_ways())
        ends = (places[:2] @ np.array([-self.axis[1], self.axis[0]]))[:, None]
        nearest_side = np.maximum((ends - ways).max(axis=0), -(ends + ways).min(axis=0))
        self.across = np.maximum(0.0, nearest_side)
        # at a change d of the speed the way in h is the mean speed times h, give or take
        # a_max h² / 4 (1 - (d / (a_max h))²), and half a cell of place and speed at either end
        self.steps = list[tuple[int, int]]()  # change of the column, rows to either side
        for change in range(-speeds - 1, speeds + 2):
            share = max(0, abs(change) - 1) / speeds
            bulge = max(0.0, speeds * self.gap * self.h / 4 * (1 - share**2))
            self.steps.append((change, int((bulge + self.gap * self.h / 2) / self.side + 1 + 1e-9)))

    def rewards(self, k: int, prices: Real) -> Real:
        """Return what the cells are worth at instant k and `prices` (B,), (B, columns, rows)."""
        kin, links = self.problem.kinematics, self.problem.links
        speed, rows, part = self.gap * self.columns, len(self.x), self.side / _PARTS
        found = np.zeros((2, len(speed), rows))
        for slot in self.blocks[k].tolist():
            tau = slot * kin.time_step - float(self.instants[k])
            off = (self.side + part + self.gap * abs(tau) + kin.max_acceleration * tau**2) / 2
            shifts = np.rint(speed * tau / part).astype(np.intp)
            most = int(np.abs(shifts).max())
            table = self.x[0] + part * np.arange(-most, _PARTS * (rows - 1) + most + 1)
            inner = most + shifts[:, None] + _PARTS * np.arange(rows)
            for hop, link in enumerate(links):
                away = self.along[2 + hop] - table
                # beyond the first row, any place; beyond the last, any too
                gone = np.maximum(0.0, np.stack([np.abs(away), away, -away]) - off)
                near = np.hypot(gone, self.across[slot])
                gain = link.gains.most_between(near, np.array(self.problem.farthest(link)))
                rates = self.rates.at(hop, slot, gain)
                for at, rate in zip((slice(1, -1), [0], [-1]), rates, strict=True):
                    found[hop][:, at] += rate[inner[:, at]]
        price = prices[:, None, None]
        return np.where(self._alive(k), price * found[0] + (1 - price) * found[1], -np.inf)

    def _alive(self, k: int) -> Flags:
        """Return whether a flight can be in each cell (columns, rows) at instant k."""
        kin, t = self.problem.kinematics, float(self.instants[k])
        speed = self.gap * self.columns[:, None]
        left = kin.time_step * (kin.slots - 1) - t
        alive = np.ones((len(speed), len(self.x)), dtype=np.bool_)
        for place, since, sign, velocity, bounded in (
            (self.along[0], t, -1, kin.start_velocity, kin.bound_first_acceleration),
            (self.along[1], left, 1, kin.end_velocity, True),
        ):
            # without the limit (13f) in slot 0 the first step goes v_max delta_t at most
            tau = since if bounded else since - kin.time_step
            off = kin.max_acceleration * tau**2 / 2 + (self.side + self.gap * tau) / 2
            off += 0.0 if bounded else kin.max_speed * kin.time_step
            ahead = self.x + sign * speed * tau - place
            above, below = ahead <= off, ahead >= -off
            above[:, 0] = below[:, -1] = True  # any place beyond
            alive &= above & below
            if velocity is not None and bounded:
                change = np.abs(speed - float(velocity @ self.axis))
                alive &= change <= kin.max_acceleration * tau + self.gap / 2
        return alive

    def reached(self, values: Real, sign: int) -> Real:
        """Return the largest of `values` (B, columns, rows) within one step.

        That is a step later with `sign` 1, a step earlier with -1.
        """
        # one after the other: the cache of a processor holds one of them, not all
        return np.stack([self._reached(each, sign) for each in values])

    def _reached(self, values: Real, sign: int) -> Real:
        rows, most = values.shape[-1], int(self.columns[-1])
        room = most + max(reach for _, reach in self.steps)
        ahead = sign * self.columns[:, None]
        source = np.clip(ahead + np.arange(-room, rows + room), 0, rows - 1)
        sheared = np.take_along_axis(values, source, axis=-1)
        best = np.full_like(sheared, -np.inf)
        widened = largest_within(sheared, (reach for _, reach in self.steps))
        up = np.maximum.accumulate(values, axis=-1)
        down = np.maximum.accumulate(values[:, ::-1], axis=-1)[:, ::-1]
        first, last = np.full((2, len(values)), -np.inf)
        for change, reach in self.steps:
            here = slice(max(0, -change), len(self.columns) - max(0, change))
            there = slice(max(0, change), len(self.columns) - max(0, -change))
            np.maximum(best[here], widened[reach][there], out=best[here])
            # from beyond an edge: any place up to what the edge itself reaches
            way = sign * (self.columns[here] + self.columns[there])
            number = np.arange(len(self.columns))[there]
            top = np.clip(way + reach, 0, rows - 1)
            bottom = np.clip(rows - 1 + way - reach, 0, rows - 1)
            np.maximum(first[here], up[number, top], out=first[here])
            np.maximum(last[here], down[number, bottom], out=last[here])
        found = np.take_along_axis(best, ahead + np.arange(rows) + room, axis=-1)
        found[:, 0], found[:, -1] = first, last
        return found

    def bound(self, prices: Sequence[float]) -> float:
        """Return what no flight exceeds at `prices`, bit/s/Hz.

        Through each cell half-way a flight is worth no more than at any of the prices.
        """
        p, count = np.clip(np.array(prices), 0.0, 1.0), len(self.instants)
        half = count // 2
        through = self._since(range(half + 1), -1, p)
        if count > half + 1:
            through += self.reached(self._since(range(count - 1, half, -1), 1, p), 1)
        ends = np.array([at_ends(self.problem, self.rates, price) for price in p.tolist()])
        worst = (through + ends[:, None, None]).min(axis=0)
        return float(worst.max()) / self.problem.kinematics.slots

    def _since(self, order: range, sign: int, prices: Real) -> Real:
        """Return the best sums (B, columns, rows) from one end on, at the last of the `order`."""
        values = self.rewards(order[0], prices)
        for k in order[1:]:
            values = self.rewards(k, prices) + self.reached(values, sign)
        return values
