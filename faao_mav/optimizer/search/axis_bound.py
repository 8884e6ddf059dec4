"""An upper bound on every flight by prices on both hops and accelerations along one axis.

Along the line through the stations a flight is a motion with |v| <= v_max and |a| <= a_max, and
dynamic programming over cells of place and speed knows these limits. Across the line the flight
is, in every slot, as near as the way from its start and the way to its end let it be. Cells, steps
and rates are rounded outwards, so that no flight is missed: whatever the price lambda from 0 to 1
of what the relay receives, no flight exceeds the largest sum of lambda I_U + (1 - lambda) I_G.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.search.best_rates import BestRates
from faao_mav.optimizer.search.map_bound import PARTS, at_ends, best_price
from faao_mav.optimizer.search.sweep import MOST_INSTANTS, largest_within

_BEYOND = 40.0
"""How far the axis goes beyond stations and ends, m; farther out counts as there. Chosen."""

_INTERVAL, _MOST_CELLS = 2.4, 100_000
"""Time between instants, s, at least; and cells at one, at most: where a_max is small the instants
lie farther apart. Chosen."""

_APART = (-0.05, -0.01, 0.01, 0.05)
"""Prices of the bound beside that of the lowest bound in coarse cells. Several part the flights by
where they are half-way: those near one station are worth less where the other is priced. Measured
on `paper_active.yaml` at 10 dBm: the outer ones serve T = 50 s, the inner ones T = 150 s."""

_COARSE, _FINE = 6, 12
"""Cells of the speed that a_max crosses between instants: for the price, and the bound. Chosen:
with more the bound is tighter; its time grows with their cube."""

_PASSED, _MERGED, _PARTED = 0.8, 2.5, 10
"""When flights are parted by their place across the axis, over sqrt(distance / a_max); how many
times as long the parts are kept apart; and how many there are. Measured with `paper_active.yaml`
at 10 dBm, T = 50 s: the bound is 8 % above the plan without parts, 5 % with these."""

_BEHIND, _BEFORE = 0.15, 0.55
"""Limits of the parts, beyond and before the axis, over the distance of the end. Measured with the
same plan: with 0.25 and 0.75 the bound is 0.3 % higher."""


class AxisBound:
    """Cells of place and speed along the axis through the stations, at K instants of a flight.

    a_max crosses `speeds` cells of the speed between two instants. Row i of the cells is at the
    place `x`[i], `side` m apart, column j at the speed `gap` `columns`[j], m/s, from -v_max to
    v_max. With `side` = `gap` h / 2 a step of h seconds from column i to column j goes i + j rows,
    and as far to either side as the acceleration lets it. The first and the last row stand for all
    places beyond. Flights are of `parts` kinds by where they pass across the axis, which no slot is
    nearer to than `across` (n,), m. Start, end and stations are at `places` (2, 4), m, along and
    across it. Instants are at `t` (K,), s, and stand for the slots `blocks`.
    """

    def __init__(self, problem: Problem, rates: BestRates, speeds: int, parts: int = 1) -> None:
        self.problem, self.rates, self.speeds, self.parts = problem, rates, speeds, parts
        kin, (first, second) = problem.kinematics, (link.gains.station for link in problem.links)
        apart = float(np.hypot(*(second - first)))
        self.axis = (second - first) / apart if apart > 0 else np.array([1.0, 0.0])
        turned = np.stack([self.axis, [-self.axis[1], self.axis[0]]])
        self.places = turned @ (np.array([kin.start, kin.end, first, second]) - first).T
        low, high = self.places[0].min() - _BEYOND, self.places[0].max() + _BEYOND

        inner = np.arange(1, kin.slots - 1)
        lasting = kin.time_step * len(inner)
        crossed = 4 * speeds**2 * kin.max_speed * (high - low) / kin.max_acceleration**2
        least = max(_INTERVAL, (crossed / _MOST_CELLS) ** (1 / 3))
        count = max(1, min(int(lasting / least), MOST_INSTANTS, len(inner)))
        self.h = h = lasting / count
        self.t: Real = kin.time_step / 2 + h * (np.arange(count, dtype=np.float64) + 0.5)
        nearest = np.abs(self.t[:, None] - kin.time_step * inner).argmin(axis=0)
        self.blocks = [inner[nearest == k] for k in range(count)]

        self.gap = kin.max_acceleration * h / speeds
        self.side = self.gap * h / 2
        most = int(np.ceil(kin.max_speed / self.gap))
        self.columns: Integers = np.arange(-most, most + 1)
        self.x: Real = low + self.side * np.arange(int((high - low) / self.side) + 2)
        ways, ends = np.array(kin.longest_ways()), self.places[1][:2, None]
        beyond = np.maximum((ends - ways).max(axis=0), -(ends + ways).min(axis=0))
        self.across: Real = np.maximum(0.0, beyond)

    @cached_property
    def passed(self) -> tuple[float, list[Real]]:
        """When flights are parted by their place y_c across the axis, s, and how near parts come.

        From the start, and back from the end, (parts, n) each, m: a flight at y_1 at time s and at
        y_c at t_c is, at t, within a_max |t - s| |t - t_c| / 2 of the line through both.
        """
        kin = self.problem.kinematics
        n, dt, most = kin.slots, kin.time_step, kin.max_acceleration
        base, ends = self.across, self.places[1][:2]
        far = float(np.abs(ends).max())
        when = max(2 * dt, min(_PASSED * np.sqrt(far / most), dt * (n - 1) / 4))
        found = []
        for end, bounded in zip(ends, (kin.bound_first_acceleration, True), strict=True):
            y = float(end)
            s, near = (0.0, 0.0) if bounded else (dt, kin.max_speed * dt)
            inner = np.linspace(-_BEHIND, _BEFORE, self.parts - 1) * y
            limits = np.sort([*inner, -np.inf, np.inf])
            limits = np.clip(limits, y - kin.max_speed * when, y + kin.max_speed * when)
            t = dt * np.arange(n)
            share, bend = (t - s) / (when - s), most * np.abs((t - s) * (t - when)) / 2
            off = near * np.abs(1 - share) + bend
            line = y * (1 - share) + limits[:, None] * share
            away = np.maximum(line[:-1] - off, -line[1:] - off)
            found.append(np.maximum(0.0, np.where(t < s, 0.0, away)))
        return when, [np.maximum(base, found[0]), np.maximum(base, found[1][:, ::-1])]

    @cached_property
    def steps(self) -> list[tuple[int, int]]:
        """Changes of the column in one step, and how many rows each reaches to either side.

        At a change d of the speed the way in h is the mean speed times h, give or take
        a_max h² / 4 (1 - (d / (a_max h))²).
        """
        h, gain = self.h, self.problem.kinematics.max_acceleration * self.h
        found = []
        for change in range(-self.speeds - 1, self.speeds + 2):
            least = max(0, abs(change) - 1) * self.gap
            bulge = max(0.0, gain * h / 4 * (1 - (least / gain) ** 2))
            # half a cell of the place and of the speed at either end
            found.append((change, int((bulge + self.gap * h / 2) / self.side + 1 + 1e-9)))
        return found

    def rewards(self, k: int, prices: Real, across: Real) -> Real:
        """Return what the cells are worth at instant k, (parts, B, columns, rows).

        At `prices` (B,), with flights that come as near to the axis as `across` (parts, n), m.
        """
        kin = self.problem.kinematics
        speed, rows = self.gap * self.columns, len(self.x)
        found = np.zeros((2, len(across), 1, len(speed), rows))
        part = self.side / PARTS
        for slot in self.blocks[k].tolist():
            tau = slot * kin.time_step - float(self.t[k])
            off = (self.side + part + self.gap * abs(tau) + kin.max_acceleration * tau**2) / 2
            shifts = np.rint(speed * tau / part).astype(np.intp)
            most = int(np.abs(shifts).max())
            table = self.x[0] + part * np.arange(-most, PARTS * (rows - 1) + most + 1)
            inner = most + shifts[:, None] + PARTS * np.arange(rows)
            for link, hop in enumerate(self.problem.links):
                away = self.places[0][2 + link] - table
                # beyond the first row, any place; beyond the last, any too
                gone = np.maximum(0.0, np.stack([np.abs(away), away, -away]) - off)
                near = np.hypot(gone[:, None], across[:, slot, None])
                gain = hop.gains.most_between(near, np.array(self.problem.farthest(hop)))
                rates = self.rates.at(link, slot, gain)
                for columns, rate in zip(
                    (slice(1, -1), slice(0, 1), slice(-1, None)), rates, strict=True
                ):
                    found[link, :, 0, :, columns] += rate[:, inner[:, columns]]
        worth = prices[:, None, None] * found[0] + (1 - prices[:, None, None]) * found[1]
        return np.where(self._alive(k), worth, -np.inf)

    def _alive(self, k: int) -> Flags:
        """Return whether a flight can be in each cell (columns, rows) at instant k."""
        kin, t = self.problem.kinematics, float(self.t[k])
        speed = self.gap * self.columns[:, None]
        left = kin.time_step * (kin.slots - 1) - t
        alive = np.ones((len(speed), len(self.x)), dtype=np.bool_)
        for place, since, sign, velocity, bounded in (
            (self.places[0][0], t, -1, kin.start_velocity, kin.bound_first_acceleration),
            (self.places[0][1], left, 1, kin.end_velocity, True),
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
        """Return the largest of `values` (..., columns, rows) within one step.

        That is a step later with `sign` 1, a step earlier with -1.
        """
        # one after the other: the cache of a processor holds one of them, not all
        flat = values.reshape(-1, *values.shape[-2:])
        return np.stack([self._reached(each, sign) for each in flat]).reshape(values.shape)

    def _reached(self, values: Real, sign: int) -> Real:
        rows, most = values.shape[-1], int(self.columns[-1])
        room = most + max(reach for _, reach in self.steps)
        ahead = sign * self.columns[:, None]
        source = np.clip(ahead + np.arange(-room, rows + room), 0, rows - 1)
        sheared = np.take_along_axis(values, source, axis=-1)
        best = np.full_like(sheared, -np.inf)
        widened = largest_within(sheared, (reach for _, reach in self.steps))
        up = np.maximum.accumulate(values, axis=-1)
        down = np.maximum.accumulate(values[..., ::-1], axis=-1)[..., ::-1]
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
        back = ahead + np.arange(rows) + room
        found = np.take_along_axis(best, back, axis=-1)
        found[:, 0], found[:, -1] = first, last
        return found

    def bound(self, prices: Sequence[float]) -> float:
        """Return what no flight exceeds at `prices`, bit/s/Hz.

        Through each cell half-way a flight is worth no more than at any of the prices.
        """
        p = np.clip(np.array(prices), 0.0, 1.0)
        count = len(self.t)
        ends = np.array([at_ends(self.problem, self.rates, price) for price in p.tolist()])
        before = self._since(range(count // 2 + 1), 0, p)
        after = self.reached(self._since(range(count - 1, count // 2, -1), 1, p), 1)
        through = before + after + ends[:, None, None]
        return float(through.min(axis=0).max()) / self.problem.kinematics.slots

    def _since(self, order: range, end: int, prices: Real) -> Real:
        """Return the best sums (B, columns, rows) from one end on, at the last instant of `order`.

        Of all parts of the flights the best counts, from some time after they are parted on.
        """
        kin, when, parts = self.problem.kinematics, *self.passed
        values = np.zeros((len(parts[end]), 1, len(self.columns), len(self.x)))
        for k in order:
            t = float(self.t[k])
            since = kin.time_step * (kin.slots - 1) - t if end else t
            across = parts[end] if since < _MERGED * when else self.across[None]
            if len(values) > len(across):
                values = values.max(axis=0, keepdims=True)
            values = self.reached(values, 1 if end else -1) + self.rewards(k, prices, across)
        return np.asarray(values.max(axis=0))


def axis_bound(problem: Problem, rates: BestRates) -> float:
    """Return an upper bound on R_avg of all flights, bit/s/Hz, full duplex only.

    `rates` are upper bounds on the best rates. The price is sought in coarse cells.
    """
    price = best_price(AxisBound(problem, rates, _COARSE).bound)
    return AxisBound(problem, rates, _FINE, _PARTED).bound([price + apart for apart in _APART])
