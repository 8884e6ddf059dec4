"""A route's predicted flight on the plan's clock, how far it is from the plan, what it delivers."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.autopilot import Flown
from faao_mav.optimizer.solution import Rates, Solution
from faao_mav.radio.relay import Relayed
from faao_mav.schedule.route import Route
from faao_mav.vector import distances_to_path, lengths

# Metres of position error that one second too late or too early at the end costs. Chosen between
# punctual and near: with 2, 5 and 8 the means over 28 conversions are 0.11, 0.06 and 0.05 s, and
# 1.44, 1.57 and 1.59 m rms.
LATE_WEIGHT = 5.0

# Metres of position error that one metre of path error beyond the path tolerance costs. Raised from
# 5, with which not every plan of benchmarks/missions.py kept its tolerance.
_PATH_WEIGHT = 8.0

# Seconds before and after a waypoint counts as reached, in which it is passed. Chosen: longer than
# crossing an acceptance radius takes, shorter than coming back.
PASSING_WINDOW = 3.0


@dataclass(frozen=True, slots=True)
class Deviation:
    """How far a flight is from the plan.

    `rms` and `max` are the distances between planned and flown positions at equal times, m; `path`
    is the largest distance, m, of either path from the other; `late` is by how much later than
    planned the flight is over, s, below 0 if it is early.
    """

    rms: float
    max: float
    path: float
    late: float


@dataclass(frozen=True, eq=False)
class Schedule:
    """A route with its predicted flight, beside the plan: it is at `w` (n, 2), m, at `t` (n,), s.

    The flight is over when the aircraft is within `tolerance` m of the plan's end.
    """

    route: Route
    flown: Flown
    t: Real
    w: Real
    tolerance: float

    @cached_property
    def met(self) -> float:
        """The time of `flown`, s, at which the aircraft leaves or, after a run-in, passes w_I."""
        first, flown = self.route.first, self.flown
        if first == 0:
            return float(flown.departures[0])
        return passing(flown.t, flown.position[:, :2], self.w[0], float(flown.arrivals[first]))

    @property
    def start(self) -> float:
        """The time of `flown`, s, at which the plan's clock reads 0.

        An aircraft that starts from a hover takes longer to move than a plan does: it leaves by
        the route's lead before the plan.
        """
        route = self.route
        planned = route.arrivals[route.first] if route.first else route.departures[0]
        return self.met + route.lead - float(planned)

    @property
    def _clocked(self) -> tuple[Real, Real]:
        """The plan's times (k,), s, and where the flight then is, (k, 2), m."""
        return self.flown.t - self.start, self.flown.position[:, :2]

    @cached_property
    def late(self) -> float:
        """By how much later than planned the flight is over, s."""
        return lateness(self.t, self.w, *self._clocked, self.tolerance)

    def positions(self, t: Real) -> Real:
        """Return where the aircraft is predicted to be at the plan's times `t` (k,), (k, 2)."""
        return positions_at(t + self.start, self.flown.t, self.flown.position[:, :2])

    def track(self) -> dict[str, Real]:
        """Return the predicted relay flight on the plan's clock, as `--save` keeps it.

        `predicted_t` (k,), s; `predicted_w` and `predicted_v` (k, 2), east and north, m and m/s.
        """
        t, w = self._clocked
        return {"predicted_t": t, "predicted_w": w, "predicted_v": self.flown.velocity[:, :2]}

    @cached_property
    def deviation(self) -> Deviation:
        """How far the predicted flight is from the plan."""
        return deviation(self.t, self.w, *self._clocked, self.tolerance)

    @property
    def error(self) -> float:
        """Root of the sum of squares of rms position error and weighted lateness, m."""
        return float(np.hypot(self.deviation.rms, LATE_WEIGHT * self.deviation.late))

    @property
    def cost(self) -> float:
        """What the schedulers minimise, m: `error`, and what the path errs beyond its tolerance."""
        return self.error + _PATH_WEIGHT * max(0.0, self.deviation.path - self.tolerance)


def deviation(planned_t: Real, planned_w: Real, t: Real, w: Real, tolerance: float) -> Deviation:
    """Compare a flight at `w` (k, 2), m, with the plan at `planned_w` (n, 2), m.

    `t` (k,) and `planned_t` (n,), s, are on the plan's clock. The flight is over within `tolerance`
    m of the plan's last position; until then its path counts.
    """
    at = positions_at(planned_t, t, w)
    apart = lengths(at - planned_w)
    late = lateness(planned_t, planned_w, t, w, tolerance)
    begin, end = planned_t[0], planned_t[-1] + late  # a path flown late or early is the same path
    inside = t[(t > begin) & (t < end)]
    path = positions_at(np.concatenate([[begin], inside, [end]]), t, w)
    return Deviation(
        rms=float(np.sqrt(np.mean(apart**2))),
        max=float(apart.max()),
        path=float(
            max(distances_to_path(path, planned_w).max(), distances_to_path(planned_w, path).max())
        ),
        late=late,
    )


_WAY_WEIGHT = 4.0
"""Metres by which the way may be longer or shorter for a pass one metre nearer to the end: corners
are cut, winds bend ways. Chosen."""


def lateness(
    planned_t: Real, planned_w: Real, flown_t: Real, flown_w: Real, tolerance: float
) -> float:
    """Return by how much later than planned a flight is over, s.

    A flight is over when it comes within `tolerance` m of the plan's last position for good. Times
    (n,), (k,), s, are on the plan's clock, positions (n, 2), (k, 2) in metres.

    >>> t = np.arange(0.0, 11.0)
    >>> w = np.column_stack([t, 0 * t])
    >>> lateness(t, w, t + 0.5, w, 2.0)
    0.5
    """
    begin, planned = float(planned_t[0]), _way_flown(planned_w)
    flown = _way_flown(flown_w)
    flown -= np.interp(begin, flown_t, flown)
    end, length = planned_w[-1], float(planned[-1])
    over = _end_time(flown_t, flown_w, end, tolerance, np.abs(flown - length))
    return max(over, begin) - _end_time(planned_t, planned_w, end, tolerance, length - planned)


def positions_at(times: Real, t: Real, w: Real) -> Real:
    """Return where a flight at `w` (k, 2) m at `t` (k,) s is at `times` (n,), (n, 2)."""
    return np.stack([np.interp(times, t, x) for x in w.T], axis=-1)


def passing(t: Real, w: Real, place: Real, about: float) -> float:
    """Return when a flight at `w` (k, 2) m at `t` (k,) s is closest to `place` (2,) m, s.

    That is within 3 s of `about`, s: an autopilot counts a waypoint as reached within a radius of
    it, before or after it is closest.
    """
    first, last = np.searchsorted(t, [about - PASSING_WINDOW, about + PASSING_WINDOW])
    t, w = t[first:last], w[first:last]
    steps = np.diff(w, axis=0)
    along = np.sum((place - w[:-1]) * steps, axis=1)
    share = np.clip(along / np.maximum(np.sum(steps**2, axis=1), 1e-9), 0.0, 1.0)
    k = int(np.argmin(lengths(w[:-1] + share[:, None] * steps - place)))
    return float(t[k] + share[k] * (t[k + 1] - t[k]))


def _way_flown(w: Real) -> Real:
    """Return the length of the way along `w` (k, 2) until each of its places, (k,) m."""
    return np.concatenate([[0.0], np.cumsum(lengths(np.diff(w, axis=0)))])


def _end_time(t: Real, w: Real, end: Real, tolerance: float, way_off: Real) -> float:
    """Return when a flight at `w` (k, 2) m at `t` (k,) s comes within `tolerance` m of `end`.

    That is for good; one that goes on past `end` does so when it last comes near before it is
    closest. A flight may pass `end` more than once, on its way or round after round: the pass that
    counts is close to it, after as long a way as planned, from which `way_off` (k,) m differ. A
    metre of `_WAY_WEIGHT` off weighs as much as one from `end`. However late, it is the same way.
    """
    apart = lengths(w - end)
    arrived = int(np.argmin(apart + way_off / _WAY_WEIGHT))
    outside = np.flatnonzero(apart[:arrived] > tolerance)
    if len(outside) == 0:
        return float(t[0])
    k = int(outside[-1])
    nearer = apart[k] - apart[k + 1]
    share = (apart[k] - tolerance) / nearer if nearer else 1.0  # it stands still, not there
    return float(t[k] + max(0.0, min(1.0, share)) * (t[k + 1] - t[k]))


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """The relay flight as it is predicted, on the plan's clock.

    `w` (n, 2), m, is where the aircraft is in each of the plan's slots. `I_U` and `I_G` (n,) of
    (7), (8), bits, are what it gets there with the slot's precoders. `relayed` is what the relay
    makes of them, forwarding as fast as it can, in half duplex within the slot's planned share.
    `by_position` are R_U and R_G, and `delivered_by_position` the delivered rate, bit/s/Hz, if the
    radio takes precoders and share of the slot planned nearest to where it is instead.
    `duration`, s, is T plus by how much later than planned the aircraft comes to w_F, within
    the path tolerance and for good. Errors are metres, at equal times and of the path.
    """

    w: Real
    I_U: Real
    I_G: Real
    relayed: Relayed
    by_position: Rates
    delivered_by_position: float
    duration: float
    max_path_error: float
    max_position_error: float
    rms_position_error: float

    def __repr__(self) -> str:
        """Say what is delivered, and how near the plan the flight is, in a line."""
        near = f"{self.rms_position_error:.2g} m rms from the plan"
        return f"<Prediction: {self.delivered_rate:.4f} bit/s/Hz in {self.duration:.1f} s, {near}>"

    @property
    def rates(self) -> Rates:
        """R_U, R_G and R_avg of (9), (10), bit/s/Hz."""
        return Rates(float(self.I_U.mean()), float(self.I_G.mean()))

    @property
    def delivered_rate(self) -> float:
        """The delivered rate of the predicted flight, bit/s/Hz."""
        return self.relayed.rate


def price_flight(solution: Solution, t: Real, w: Real) -> Prediction:
    """Return what the channel of `solution` delivers along a flight.

    The aircraft is at `w` (k, 2), m, at the plan's times `t` (k,), s: 0 when the plan's first slot
    begins. They increase.
    """
    at = positions_at(solution.t, t, w)
    errors = deviation(solution.t, solution.w, t, w, solution.plan.mission.path_tolerance)
    I_U, I_G = rates_along(solution, at)
    nearest, shares = nearest_slots(solution, at), solution.shares
    near_U, near_G = rates_along(solution, at, nearest)
    near_shares = shares[nearest] if shares is not None else None
    return Prediction(
        w=at,
        I_U=I_U,
        I_G=I_G,
        relayed=solution.relay(I_U, I_G, shares),
        by_position=Rates(float(np.mean(near_U)), float(np.mean(near_G))),
        delivered_by_position=solution.relay(near_U, near_G, near_shares).rate,
        duration=solution.plan.flight.duration + errors.late,
        max_path_error=errors.path,
        max_position_error=errors.max,
        rms_position_error=errors.rms,
    )


def rates_along(solution: Solution, w: Real, slots: Integers | None = None) -> tuple[Real, Real]:
    """Return I_U (7) and I_G (8), bits, each (n,), where the aircraft is at `w` (n, 2) in slot n.

    Each slot keeps its fading; the line of sight and the path gain are those at `w`. The
    precoders are those of the same slot, or of `slots` (n,), as `nearest_slots` gives for a radio
    that goes by position. Precoders that know the draw of an averaged fading stay with the draw.
    """
    of = slice(None) if slots is None else slots
    I_U, I_G = (
        link.mean_rates(link.channel(w), P[..., of, :, :])
        for link, P in zip(solution.problem.links, (solution.P_B, solution.P_U), strict=True)
    )
    return I_U, I_G


def nearest_slots(solution: Solution, w: Real) -> Integers:
    """Return for each of `w` (n, 2), m, the slot (n,) that is planned nearest to it.

    Of slots at one place, where the aircraft hovers, it is the first.
    """
    import shapely  # as in transit: only predictions need it

    places, first = np.unique(solution.w, axis=0, return_index=True)
    tree = shapely.STRtree(np.asarray(shapely.points(places)))
    _, nearest = tree.query_nearest(shapely.points(w), all_matches=False)
    return np.asarray(first[nearest])
