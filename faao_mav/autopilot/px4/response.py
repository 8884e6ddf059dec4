"""How the aircraft follows the smoothed trajectory."""

from functools import lru_cache
from math import ceil
from typing import TypeAlias, TypeVar

import numpy as np

from faao_mav.arrays import Real

POSITION_GAIN = 0.95
"""MPC_XY_P, 1/s."""

VELOCITY_GAINS = (1.8, 0.4, 0.2)
"""MPC_XY_VEL_P_ACC 1/s, MPC_XY_VEL_I_ACC 1/s², MPC_XY_VEL_D_ACC."""

_POSITION, _VELOCITY, _THRUST, _INTEGRAL = range(4)
_TRAJECTORY, _CHANGES, _STATES = 4, 7, 10
"""First of the trajectory's position, velocity, acceleration; of their changes; how many in all."""

_CAUSES = [_POSITION, _VELOCITY, _THRUST, _INTEGRAL, 5, 7, 6, 8, 9]
"""The states that a `StepFactors` looks at: the position's lag says all of the two positions."""

_LEAST_TERMS, _TERMS_BY_LAG = 12, 2.4
"""The least number of terms of the series of exp(A dt); at a lag of T s there are 2.4 / T + 2.
Measured: for lags from 0.05 s on and steps of 0.4 s what is left out is below 1e-5."""

Number = TypeVar("Number", float, complex)

Motion: TypeAlias = tuple[Number, Number, Number, Number, Number, Number, Number]
"""The aircraft's position, velocity, thrust over mass and velocity integral; the trajectory's
position, velocity and acceleration. Horizontal motion is complex, vertical motion real: altitude is
taken to be held as tightly as position."""

FactorRow: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
StepFactors: TypeAlias = tuple[FactorRow, FactorRow, FactorRow, FactorRow]
"""What the aircraft's four states become, as factors of: the lag of its position; its other states;
the trajectory's velocity, displacement and acceleration, changes of velocity and acceleration."""


def advance(
    step: StepFactors, motion: Motion[Number], shift: Number, velocity: Number, acceleration: Number
) -> Motion[Number]:
    """Return `motion` after a step that takes the trajectory to the new velocity, and by `shift`.

    A cascaded position and velocity controller about an aircraft with lag and drag: a linear
    system, which the trajectory drives by changing evenly over the step.
    """
    position, a, b, c, place, d, push = motion
    lag = position - place
    p, v, t, n = step
    ahead = _sum(p, lag, a, b, c, d, shift)
    speed = _sum(v, lag, a, b, c, d, shift)
    thrust = _sum(t, lag, a, b, c, d, shift)
    integral = _sum(n, lag, a, b, c, d, shift)
    if push or acceleration or velocity != d:  # seldom: most of a flight is at one velocity
        rise, jolt = velocity - d, acceleration - push
        ahead += p[6] * push + p[7] * rise + p[8] * jolt
        speed += v[6] * push + v[7] * rise + v[8] * jolt
        thrust += t[6] * push + t[7] * rise + t[8] * jolt
        integral += n[6] * push + n[7] * rise + n[8] * jolt
    return place + ahead, speed, thrust, integral, place + shift, velocity, acceleration


def _sum(
    row: FactorRow, lag: Number, a: Number, b: Number, c: Number, d: Number, shift: Number
) -> Number:
    of_lag, of_a, of_b, of_c, of_d, of_shift, _, _, _ = row
    return of_lag * lag + of_a * a + of_b * b + of_c * c + of_d * d + of_shift * shift


@lru_cache(maxsize=1024)
def step_of(dt: float, lag: float, drag: float) -> StepFactors:
    """Return the step of `dt` s: rows of exp(A dt), by its series.

    `lag` is the time constant from the acceleration asked for to the thrust's, s, `drag` the air's
    over mass and airspeed, 1/s.
    """
    series = _series(lag, drag)
    rows = (dt ** np.arange(len(series)) @ series).reshape(4, -1).tolist()
    return tuple(tuple(row) for row in rows)  # type: ignore[return-value]


@lru_cache(maxsize=256)
def _series(lag: float, drag: float) -> Real:
    """Return the terms A^k / k! as far as `StepFactors` needs them, (terms, 4 * 9).

    Changes are rates times dt: their columns are one power of dt ahead.
    """
    rows = np.eye(_STATES)
    proportional, integral, derivative = VELOCITY_GAINS
    position, velocity, acceleration = rows[_TRAJECTORY:_CHANGES]
    error = POSITION_GAIN * (position - rows[_POSITION]) + velocity - rows[_VELOCITY]
    motion = rows[_THRUST] - drag * rows[_VELOCITY]
    demand = acceleration + proportional * error + rows[_INTEGRAL] - derivative * motion
    system = np.zeros((_STATES, _STATES))
    system[_POSITION] = rows[_VELOCITY]
    system[_VELOCITY] = motion
    system[_THRUST] = (demand - rows[_THRUST]) / lag
    system[_INTEGRAL] = integral * error
    system[_TRAJECTORY:_CHANGES] = rows[_CHANGES:]
    terms, count = [rows], max(_LEAST_TERMS, ceil(_TERMS_BY_LAG / lag) + 2)
    for k in range(1, count + 1):
        terms.append(system @ terms[-1] / k)
    series = np.stack(terms)[:, :_TRAJECTORY]
    series[:-1, :, _CHANGES:] = series[1:, :, _CHANGES:]
    return series[:-1, :, _CAUSES].reshape(count, -1)
