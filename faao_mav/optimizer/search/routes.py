"""Flights to start from that are found globally, by dynamic programming over the map.

For weights of both hops the best flight by position alone is a sweep (see `sweep`). Of the flights
through one cell at one instant the best is worth no more than at any of the weights: where the
least of these values is largest, the flight serves both hops. Its path, which turns as it likes,
becomes a feasible flight that keeps near it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.mission.fence_area import FreeArea
from faao_mav.optimizer.interior.constraint import Constraint
from faao_mav.optimizer.interior.maximize import feasible, maximize, objectives
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.rates import link_coordinates
from faao_mav.optimizer.rates.field import RateField
from faao_mav.optimizer.search.multistart import COARSE_SLOTS, coarse_copy, resampled
from faao_mav.optimizer.search.sweep import Sweep, sweep_over
from faao_mav.optimizer.search.track import Closeness, nearest_flight
from faao_mav.radio.relay import RelayQueue

_CELLS, _FENCED_CELLS, _REACH, _INSTANTS = 400, 1600, 4.0, 24
"""Cells of the map, those with a fence, reach of a step in cells, and instants at most. Chosen."""

_LEVELS, _FALLS = (0.45, 0.5, 0.55), (0.4, 0.0, -0.4)
"""Weights of the first hop at half time, and by how much they fall from the start to the end: the
stations are visited in this order, in none, or in the other. Chosen."""

PATHS = 2
"""Paths that become flights; one where flights are too short for the coarse copy. Measured on the
plans of `benchmarks`, with the straight flight beside them: no optimum is below
that of the five named starts by more than 1e-4. With 1 that of the paper's plan with T = 100 s and
10 dBm is by 1.4 %."""

_DECIMALS = 6
"""Decimals of the rates, bit/s/Hz, by which paths are ranked: see `multistart`."""

_HURRY = 1.25
"""Speed on the map over that of the straight flight, at least. Chosen."""

_NEAR, _STEPS = 0.3, 25
"""Tolerance and steps of the search for a feasible flight near a path, a start only. Chosen."""

_DISTANCES = 24
"""Distances at which the rates are asked for. Chosen."""


def global_flights(
    kin: Kinematics,
    field: RateField,
    relay: RelayQueue | None,
    start: Trajectory,
    *,
    free: FreeArea | None = None,
    kept: Sequence[Constraint] = (),
) -> dict[str, Trajectory]:
    """Return feasible flights near the best paths, by name, the best first.

    `start` is a feasible flight; the flights keep the constraints `kept` beside the limits of
    `kin`, and paths for which none is found are left out. The rest is as in `best_paths`. Long
    flights without constraints are found on the coarse copy that they are improved on.
    """
    long = kin.slots > COARSE_SLOTS
    most = PATHS if long else 1
    copy = coarse_copy(kin) if long and kin.min_speed == 0 and not kept else kin
    begin = start if copy is kin else copy.follow(resampled(kin, start, copy))
    flights = {}
    for number, path in enumerate(best_paths(kin, field, relay, free=free, most=most), start=1):
        if kept:
            flight = nearest_flight(kin, path, start, kept)
            if flight is not None:
                flights[f"global {number}"] = flight
            continue
        share = np.linspace(0, 1, copy.slots), np.linspace(0, 1, kin.slots)
        near = Closeness(np.stack([np.interp(*share, column) for column in path.T], axis=1))
        end = maximize(copy, near, begin, tolerance=_NEAR, max_iterations=_STEPS).trajectory
        if copy is not kin:
            end = feasible(kin, start, resampled(copy, end, kin))
        flights[f"global {number}"] = end
    return flights


def best_paths(
    kin: Kinematics,
    field: RateField,
    relay: RelayQueue | None,
    *,
    free: FreeArea | None = None,
    most: int = PATHS,
) -> list[Real]:
    """Return the `most` best of the paths (n, 2) found, m, the best first; they ignore a_max.

    Args:
        kin: the feasible set.
        field: the rates of both hops.
        relay: the queue whose delivered rate counts instead of the smaller mean.
        free: where the aircraft may be, everywhere if None.
        most: how many paths at most.
    """
    stations = np.array([link.station for link in field.links])
    sweep = sweep_over(
        replace(kin, max_speed=_usual_speed(kin, stations)),
        stations,
        cells=_CELLS if free is None else _FENCED_CELLS,
        reach=_REACH if free is None else 2 * _REACH,
        most_instants=_INSTANTS,
        free=free,
    )
    rates = _mean_rates(field, sweep, kin.slots)
    count = len(sweep.blocks)
    over = np.linspace(0.5, -0.5, count)
    weights = np.array([level + fall * over for fall in _FALLS for level in _LEVELS])
    weights = weights.T[..., None, None]
    received, forwarded = weights * rates[0], (1 - weights) * rates[1]
    half = relay is not None and relay.half
    worth = np.maximum(received, forwarded) if half else received + forwarded
    lengths = np.array([len(block) for block in sweep.blocks])
    rewards = np.where(sweep.alive[:, None], worth * lengths[:, None, None, None], -np.inf)
    values = sweep.backward(rewards)
    cells = np.unique(sweep.paths(values)[:, np.isfinite(values[0].max(axis=(-2, -1)))], axis=1)
    if not cells.shape[1]:
        return []
    each = np.repeat(np.arange(count), lengths)
    queue = None if relay is None else replace(relay, half=False)  # the best shares take long
    reached = objectives(rates[:, cells[0], cells[1]][..., each], kin, queue)
    ranked = np.argsort(-np.round(reached, _DECIMALS), kind="stable")
    times = kin.time_step * np.array([0, kin.slots - 1])
    knots = np.concatenate([times[:1], sweep.instants, times[1:]])
    t = kin.time_step * np.arange(kin.slots)
    found = []
    for i, j in cells[:, ranked[:most]].swapaxes(0, 1):
        points = np.vstack([kin.start, sweep.x[:, i, j].T, kin.end])
        found.append(np.stack([np.interp(t, knots, column) for column in points.T], axis=1))
    return found


def _usual_speed(kin: Kinematics, stations: Real) -> float:
    """Return the mean speed, m/s, of a flight from stop to stop over the longest way there is.

    Half of the top speed where a_max leaves no time for v_max; enough to get from start to end.
    """
    places = np.vstack([kin.start, kin.end, stations])
    longest = float(np.hypot(*(places[:, None] - places).T).max())
    mean = 0.5 * np.sqrt(kin.max_acceleration * longest)
    direct = float(np.hypot(*(kin.end - kin.start))) / (kin.time_step * (kin.slots - 1))
    return float(min(kin.max_speed, max(mean, _HURRY * direct)))


def _mean_rates(field: RateField, sweep: Sweep, slots: int) -> Real:
    """Return the mean rates of both links over all slots (2, i, j) in the cells.

    They are those in the direction of the other station. From the farthest distance to the nearest:
    rates that are searched for start each search from the precoders of the last.
    """
    known = any(link.nlos is not None and not link.averaged for link in field.links)
    a, b = (link.station for link in field.links)
    apart = b - a if (a != b).any() else np.array([1.0, 0.0])
    toward, rates = apart / np.hypot(*apart), []
    for link, rate, sign in zip(field.links, field.rates, (1, -1), strict=True):
        away = np.hypot(*(sweep.x - link.station[:, None, None]))
        r = np.linspace(0.0, float(away.max()), _DISTANCES)
        w = link.station[:, None] + sign * toward[:, None] * r
        means = []
        for place in w.T[::-1]:
            at = link_coordinates(link, np.repeat(place[:, None], slots if known else 1, axis=-1))
            means.append(float(rate.value(at.gain_log, at.cosine).mean()))
        rates.append(np.interp(away, r, means[::-1]))
    return np.stack(rates)
