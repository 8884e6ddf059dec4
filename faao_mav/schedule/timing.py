"""Speeds and holds with which the predicted flight keeps the plan's time.

minimise sum_i |p(t_i) - w(t_i)|² over the speeds commanded for the legs and the holds at the
hovers, p being the predicted flight. A Levenberg-Marquardt method with bounds on finite
differences: the prediction has no gradients, but it is smooth. All differences are flown at once,
and then all dampings: roughly, which costs less, since both are compared with a flight that is
known. What looks best is flown in full before it counts. An error early in the flight shows in
everything that follows: later legs and holds make up for earlier ones.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Integers, Real
from faao_mav.schedule.deviation import passing, settled
from faao_mav.vehicle import CopterModel, FlightPath, Flown

SPEED_STEP, HOLD_STEP = 0.02, 0.05
"""Finite differences, m/s and s: above the predictions' noise, below what the physics bends."""

MOST_LEAD = 2.0
"""Seconds that the aircraft may set out before the plan, at most."""

SHORTEST_HOLD = 1.0
"""A hold at least, s: an autopilot that is not told to wait flies through."""

_STEP = 0.25  # of the predicted flight, s
_SAMPLES = 400
_ITERATIONS = 12
_DAMPINGS = 10.0 ** np.array([-4, -2, -1, 0, 2])
_ENOUGH = 0.05
"""Share by which an iteration has to lessen the sum of squares."""

_LAST, _LAST_WEIGHT = 4.0, 3.5
"""The last seconds of the flight weigh more: they decide when it is over."""

ON_TIME, _LATEST = 5.0, 5.0
"""Metres of rms error that a second too early or too late at the end weighs, up to so many."""

_NO_CRAWL = 0.5
"""Legs are not slowed below this, m/s, unless the plan creeps."""

_LEASH = 0.05
"""Metres that a speed's departure from the plan's mean by 1 m/s weighs: keeps idle speeds put."""


@dataclass(frozen=True, slots=True, eq=False)
class Clock:
    """The plan's times and positions, and when the flight's clock meets the plan's.

    The plan's `t` (n,) s and `w` (n, 2) m. The plan reads `at` when the aircraft passes point
    `point` of its path, or, `lead` seconds after that, when it leaves it (`leaving`): an aircraft
    that starts from a hover takes longer to move than a plan does. The flight is over when it is
    within `near` m of the plan's end.
    """

    t: Real
    w: Real
    point: int
    at: float
    leaving: bool
    near: float
    lead: float = 0.0

    def start(self, flown: Flown) -> float:
        """Return the time of `flown` at which the plan's clock reads 0."""
        if self.leaving:
            return float(flown.departures[self.point]) + self.lead - self.at
        about = float(flown.arrivals[self.point])
        return passing(flown.t, flown.position[:, :2], self.w[0], about) - self.at

    def late(self, flown: Flown) -> float:
        """Return by how much later than planned `flown` is over, s."""
        end, due, t = self.w[-1], float(self.t[-1]), flown.t - self.start(flown)
        over = settled(t, flown.position[:, :2], end, self.near, due)
        return over - settled(self.t, self.w, end, self.near, due)

    def positions(self, flown: Flown, t: Real) -> Real:
        """Return where the aircraft is at the plan's times `t` (k,), (k, 2)."""
        times = t + self.start(flown)
        return np.stack([np.interp(times, flown.t, x) for x in flown.position.T[:2]], axis=-1)


def fit(
    model: CopterModel,
    path: FlightPath,
    clock: Clock,
    *,
    groups: Integers,
    free: NDArray[np.bool_],
    min_speed: float,
    max_speed: float,
) -> tuple[Real, Real, float]:
    """Return the speeds (m - 1,), the waits at the points (m,) and the lead, s, that fit best.

    Legs with the same number in `groups` (m - 1,), counted from 0, share a speed. Speeds stay
    within `min_speed` and `max_speed` (m/s), the waits at the points `free` (m,) at or above
    `SHORTEST_HOLD`; the others stay as they are. The lead is within `MOST_LEAD`, 0 for a flight
    that begins at speed. Being late or early at the end counts as well: `ON_TIME`.
    """
    waits = path.holds + path.delays
    if len(path.speeds) == 0:
        return path.speeds, waits, 0.0
    samples = np.unique(np.linspace(0, len(clock.t) - 1, _SAMPLES).astype(int))
    t, w = clock.t[samples], clock.w[samples]
    count = int(groups.max()) + 1
    means = np.bincount(groups, path.speeds) / np.bincount(groups)
    held_count, most = int(free.sum()), MOST_LEAD if clock.leaving else 0.0
    slowest = np.maximum(min_speed, np.minimum(_NO_CRAWL, means))
    low = np.concatenate([slowest, np.full(held_count, SHORTEST_HOLD), [0.0]])
    high = np.concatenate([np.full(count, max_speed), np.full(held_count, np.inf), [most]])
    steps = np.repeat([SPEED_STEP, HOLD_STEP], [count, held_count + 1])
    begin = np.clip(np.concatenate([means, waits[free], [clock.lead]]), low, high)

    def flown(x: Real) -> tuple[Real, Real]:
        held = np.tile(waits, (len(x), 1))
        held[:, free] = x[:, count:-1]
        return x[:, :count][:, groups], held

    weights = np.where(t > t[-1] - _LAST, _LAST_WEIGHT, 1.0)[:, None] / np.sqrt(len(t))

    def errors(x: Real, *, rough: bool) -> Real:
        """Return the residuals (B, r) of the variants x (B, k)."""
        apart = []
        for one, lead in zip(
            model.fly_many(path, *flown(x), _STEP, rough=rough), x[:, -1], strict=True
        ):
            led = replace(clock, lead=lead)
            late = ON_TIME * np.clip(led.late(one), -_LATEST, _LATEST)
            apart.append(np.append((led.positions(one, t) - w) * weights, late))
        leash = _LEASH * (x[:, :count] - begin[:count])
        return np.hstack([np.stack(apart), leash / np.sqrt(count)])

    x, now = begin, errors(begin[None], rough=False)[0]
    dampings = _DAMPINGS
    for _ in range(_ITERATIONS):
        signed = np.where(x + steps > high, -steps, steps)
        tried = errors(np.vstack([x, x + np.diag(signed)]), rough=True)
        slope = ((tried[1:] - tried[0]) / signed[:, None]).T
        ahead = _steps(x, slope, now, low, high, dampings)
        guessed = now + errors(ahead, rough=True) - tried[0]
        least = int(np.argmin(np.sum(guessed**2, axis=1)))
        best, chosen = ahead[least], np.flatnonzero(dampings[least] == _DAMPINGS)[0]
        dampings = _DAMPINGS[max(0, chosen - 1) : chosen + 2]
        found = errors(best[None], rough=False)[0]
        before, after = float(now @ now), float(found @ found)
        if after < before:
            x, now = best, found
        if after > (1 - _ENOUGH) * before:
            break
    speeds, held = flown(x[None])
    return speeds[0], held[0], float(x[-1])


def _steps(x: Real, slope: Real, error: Real, low: Real, high: Real, dampings: Real) -> Real:
    """Return where the damped Gauss-Newton steps lead, (dampings, k), within the bounds."""
    gradient = slope.T @ error
    stuck = ((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))
    slope = np.where(stuck, 0.0, slope)
    square = slope.T @ slope
    diagonal = np.diag(square) + 1e-12
    steps = [
        np.linalg.solve(square + np.diag(damping * diagonal + 1e-9), -slope.T @ error)
        for damping in dampings
    ]
    return np.clip(x + np.array(steps), low, high)
