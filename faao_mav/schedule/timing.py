"""Speeds and waits with which the predicted flight keeps the plan's time.

minimise sum_i |p(t_i) - w(t_i)|² over the speeds commanded for the legs, the waits at the hovers
and the lead, p being the predicted flight. A Levenberg-Marquardt method with bounds on finite
differences: the prediction has no gradients, but it is smooth. The variants of all differences are
flown at once, and then those of all dampings: roughly, which costs less, as each is compared with
a flight that is known. The best of them is flown in full before it counts. An error early in the
flight shows in everything that follows: later legs and waits make up for earlier ones.

Constants that name no source are chosen; what a change costs is not measured.
"""

from dataclasses import replace

import numpy as np

from faao_mav.arrays import Flags, Integers, Real
from faao_mav.schedule.schedule import LATE_WEIGHT, Clock
from faao_mav.vehicle import FlightModel, FlightPath

MOST_LEAD = 2.0  # the longest time by which the aircraft sets out before the plan, s
SHORTEST_HOLD = 1.0  # the shortest wait at a hover, s: untold to wait, an autopilot flies through

# Steps of the finite differences, m/s and s: above the predictions' numerical noise, and below what
# changes their slope.
_SPEED_DIFFERENCE, _WAIT_DIFFERENCE = 0.02, 0.05

_STEP = 0.25  # seconds between the samples of a predicted flight
_SAMPLES = 400  # the most instants at which a predicted flight is compared with the plan
_ITERATIONS = 12  # the most steps of a fit
_DAMPINGS = 10.0 ** np.array([-4, -2, -1, 0, 2])  # to try, of the diagonal of the squared slopes
_DIGITS = 4  # decimals of fitted values: more are noise, which another processor has otherwise
_LEAST_GAIN = 0.05  # the share of the sum of squares that a step saves for another one to follow
_MOST_LATE = 5.0  # the lateness, s, beyond which more of it costs no more
_CRAWL = 0.5  # the least speed, m/s, to which a leg is slowed that is planned to be faster

# Errors in the last seconds of the plan weigh more by a factor: they decide when it is over.
_FINAL_SECONDS, _FINAL_WEIGHT = 4.0, 3.5

# Metres of error that 1 m/s between a fitted speed and the initial one costs: it keeps speeds that
# hardly matter where they are.
_SPEED_PULL = 0.05


def fit(
    model: FlightModel,
    path: FlightPath,
    clock: Clock,
    *,
    groups: Integers,
    free: Flags,
    min_speed: float,
    max_speed: float,
) -> tuple[Real, Real, float]:
    """Return the speeds (m - 1,), the waits at the points (m,) and the lead, s, that fit best.

    Legs with the same number in `groups` (m - 1,), counted from 0, share a speed. Speeds stay
    within `min_speed` and `max_speed` (m/s), the waits at the points `free` (m,) at or above
    `SHORTEST_HOLD`; the others stay as they are. The lead is within `MOST_LEAD`, 0 for a flight
    that begins at speed. Being late or early at the end counts as well: `LATE_WEIGHT`.
    """
    waits = path.holds + path.delays
    if len(path.speeds) == 0:
        return path.speeds, waits, 0.0
    samples = np.unique(np.linspace(0, len(clock.t) - 1, _SAMPLES).astype(int))
    t, w = clock.t[samples], clock.w[samples]
    weights = np.where(t > t[-1] - _FINAL_SECONDS, _FINAL_WEIGHT, 1.0)[:, None] / np.sqrt(len(t))

    # The unknowns x: a speed for each group, the free waits, the lead.
    means = np.bincount(groups, path.speeds) / np.bincount(groups)
    speed_count, wait_count = len(means), int(free.sum())
    slowest = np.maximum(min_speed, np.minimum(_CRAWL, means))
    most_lead = MOST_LEAD if clock.leaving else 0.0
    low = np.concatenate([slowest, np.full(wait_count, SHORTEST_HOLD), [0.0]])
    high = np.concatenate(
        [np.full(speed_count, max_speed), np.full(wait_count, np.inf), [most_lead]]
    )
    differences = np.repeat([_SPEED_DIFFERENCE, _WAIT_DIFFERENCE], [speed_count, wait_count + 1])
    initial = np.clip(np.concatenate([means, waits[free], [clock.lead]]), low, high)

    def commands(x: Real) -> tuple[Real, Real]:
        """Return the speeds (B, m - 1) and the waits (B, m) of the variants x (B, k)."""
        all_waits = np.tile(waits, (len(x), 1))
        all_waits[:, free] = x[:, speed_count:-1]
        return x[:, :speed_count][:, groups], all_waits

    def residuals(x: Real, *, rough: bool) -> Real:
        """Return the residuals (B, r), m, of the variants x (B, k)."""
        rows = []
        flights = model.fly_many(path, *commands(x), _STEP, rough=rough)
        for flown, lead in zip(flights, x[:, -1], strict=True):
            led = replace(clock, lead=lead)
            late = LATE_WEIGHT * np.clip(led.late(flown), -_MOST_LATE, _MOST_LATE)
            rows.append(np.append((led.positions(flown, t) - w) * weights, late))
        pull = _SPEED_PULL * (x[:, :speed_count] - initial[:speed_count])
        return np.hstack([np.stack(rows), pull / np.sqrt(speed_count)])

    x, error = initial, residuals(initial[None], rough=False)[0]
    dampings = _DAMPINGS
    for _ in range(_ITERATIONS):
        signed = np.where(x + differences > high, -differences, differences)
        rough = residuals(np.vstack([x, x + np.diag(signed)]), rough=True)
        slope = ((rough[1:] - rough[0]) / signed[:, None]).T
        damped = _damped_steps(x, slope, error, low, high, dampings)
        estimated = error + residuals(damped, rough=True) - rough[0]
        least = int(np.argmin(np.sum(estimated**2, axis=1)))
        chosen = np.flatnonzero(dampings[least] == _DAMPINGS)[0]
        dampings = _DAMPINGS[max(0, chosen - 1) : chosen + 2]
        new = residuals(damped[least][None], rough=False)[0]
        before, after = float(error @ error), float(new @ new)
        if after < before:
            x, error = damped[least], new
        if after > (1 - _LEAST_GAIN) * before:
            break
    fitted_speeds, fitted_waits = commands(x[None])
    return fitted_speeds[0], fitted_waits[0], float(x[-1])


def _damped_steps(x: Real, slope: Real, error: Real, low: Real, high: Real, dampings: Real) -> Real:
    """Return where the damped Gauss-Newton steps from `x` (k,) lead, (dampings, k), in bounds."""
    gradient = slope.T @ error
    stuck = ((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))
    slope = np.where(stuck, 0.0, slope)
    square = slope.T @ slope
    diagonal = np.diag(square) + 1e-12
    steps = [
        np.linalg.solve(square + np.diag(damping * diagonal + 1e-9), -slope.T @ error)
        for damping in dampings
    ]
    return np.clip(np.round(x + np.array(steps), _DIGITS), low, high)
