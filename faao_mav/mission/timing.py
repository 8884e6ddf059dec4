"""Speeds and holds with which the predicted flight keeps the plan's time.

minimise sum_i |p(t_i) - w(t_i)|² over the speeds commanded for the legs and the holds at the
hovers, p being the predicted flight. A Levenberg-Marquardt method with bounds (SciPy's) on finite
differences: the prediction has no gradients, but it is smooth and quick. An error early in the
flight shows in everything that follows, so later legs and holds make up for earlier ones.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faao_mav.arrays import Real
from faao_mav.mission.flight import FlightModel, FlightPath, Flown

SPEED_STEP, HOLD_STEP = 0.02, 0.05
"""Finite differences, m/s and s: above the predictions' noise, below what the physics bends."""

_SAMPLES = 400
_ATTEMPTS = 30
_INSIDE = 1e-6  # the method starts within its bounds

SHORTEST_HOLD = 1.0
"""A hold at least, s: an autopilot that is not told to wait flies through."""

_LEASH = 0.05
"""Metres that a speed's departure from the plan's mean by 1 m/s weighs: keeps idle speeds put."""


@dataclass(frozen=True, slots=True, eq=False)
class Clock:
    """The plan's times and positions, and when the flight's clock meets the plan's.

    The plan's `t` (n,) s and `w` (n, 2) m. The plan reads `at` when the aircraft leaves point
    `point` of its path (`leaving`), or passes it.
    """

    t: Real
    w: Real
    point: int
    at: float
    leaving: bool

    def start(self, flown: Flown) -> float:
        """Return the time of `flown` at which the plan's clock reads 0."""
        met = flown.departures if self.leaving else flown.arrivals
        return float(met[self.point]) - self.at

    def positions(self, flown: Flown, t: Real) -> Real:
        """Return where the aircraft is at the plan's times `t` (k,), (k, 2)."""
        times = t + self.start(flown)
        return np.stack([np.interp(times, flown.t, x) for x in flown.position.T[:2]], axis=-1)


def fit(
    model: FlightModel,
    path: FlightPath,
    clock: Clock,
    *,
    groups: NDArray[np.int_],
    free: NDArray[np.bool_],
    min_speed: float,
    max_speed: float,
) -> FlightPath:
    """Return `path` with the speeds, and the holds at the points `free` (m,), that fit best.

    Legs with the same number in `groups` (m - 1,), counted from 0, share a speed. Speeds stay
    within `min_speed` and `max_speed` (m/s), the free holds, which are whole seconds with the rest
    as a delay, at or above `SHORTEST_HOLD`.
    """
    from scipy.optimize import least_squares

    if len(path.speeds) == 0:
        return path
    chosen = np.unique(np.linspace(0, len(clock.t) - 1, _SAMPLES).astype(int))
    t, w = clock.t[chosen], clock.w[chosen]
    count = int(groups.max()) + 1
    means = np.bincount(groups, path.speeds) / np.bincount(groups)
    low = np.concatenate([np.full(count, min_speed), np.full(free.sum(), SHORTEST_HOLD)])
    high = np.concatenate([np.full(count, max_speed), np.full(free.sum(), np.inf)])
    begin = np.concatenate([means, (path.holds + path.delays)[free]])
    begin = np.clip(begin, low + _INSIDE, high - _INSIDE)

    def with_values(x: Real) -> FlightPath:
        holds, delays = path.holds.copy(), path.delays.copy()
        holds[free] = np.floor(x[count:])
        delays[free] = x[count:] - holds[free]
        return replace(path, speeds=x[:count][groups], holds=holds, delays=delays)

    def error(x: Real) -> Real:
        apart = clock.positions(model.fly(with_values(x)), t) - w
        leash = _LEASH * (x[:count] - begin[:count])
        return np.concatenate([apart.ravel() / np.sqrt(len(t)), leash / np.sqrt(count)])

    def slope(x: Real) -> Real:
        now, columns = error(x), []
        for k in range(len(x)):
            step = SPEED_STEP if k < count else HOLD_STEP
            if x[k] + step > high[k]:
                step = -step
            moved = x.copy()
            moved[k] += step
            columns.append((error(moved) - now) / step)
        return np.column_stack(columns)

    found = least_squares(
        error, begin, jac=slope, bounds=(low, high), xtol=1e-4, ftol=1e-3, max_nfev=_ATTEMPTS
    )
    return with_values(found.x)
