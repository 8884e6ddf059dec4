"""How the aircraft follows the smoothed trajectory."""

from functools import lru_cache

import numpy as np

from faao_mav.arrays import Complex, Real

POSITION_GAIN = 0.95
"""MPC_XY_P, 1/s."""

VELOCITY_GAINS = (1.8, 0.4, 0.2)
"""MPC_XY_VEL_P_ACC 1/s, MPC_XY_VEL_I_ACC 1/s², MPC_XY_VEL_D_ACC."""

ATTITUDE_LAG = 0.25
"""Time constant from the acceleration asked for to the thrust's, s. Fitted."""

DRAG = 0.1
"""Air drag over mass, 1/s. Fitted."""

_POSITION, _VELOCITY, _THRUST, _INTEGRAL = range(4)
TRAJECTORY, CHANGES, STATES = 4, 7, 10
"""First of the trajectory's position, velocity, acceleration; of their changes; how many in all."""

_TERMS = 12
_TINY = 1e-9


class Response:
    """A cascaded position and velocity controller about an aircraft with lag and drag.

    State columns are `STATES` long: the aircraft's position, velocity, thrust over mass and
    velocity integral; the trajectory's position, velocity and acceleration; and by how much those
    change over the step, evenly. Horizontal columns are complex, vertical ones real: altitude is
    taken to be held as tightly as position. The system is linear, so a step of `step` seconds is
    one product; shorter ones sum the exponential's series.
    """

    def __init__(self, step: float) -> None:
        self._step = step
        self._transition, self._series = _matrices(step)

    def advance(self, state: Complex, dt: Real) -> Complex:
        """Return `state` (STATES, n, B) after `dt` (B,) seconds, each at most the step."""
        after = (self._transition @ state.reshape(STATES, -1)).reshape(state.shape)
        if dt.min() < self._step:
            short = dt < self._step
            after[..., short] = self._shorter(state[..., short], dt[short])
        return after

    def _shorter(self, state: Complex, dt: Real) -> Complex:
        state[CHANGES:] /= np.maximum(dt, _TINY)
        terms = (self._series @ state.reshape(STATES, -1)).reshape(_TERMS, *state.shape)
        powers = dt ** np.arange(_TERMS)[:, None]
        result: Complex = (terms * powers[:, None, None]).sum(axis=0)
        return result


@lru_cache(maxsize=8)
def _matrices(step: float) -> tuple[Complex, Complex]:
    """Return what a step multiplies, and the terms of exp(A t) about the system matrix A.

    The terms (_TERMS * STATES, STATES) are A^k / k!; there, the last states are rates of change.
    """
    rows = np.eye(STATES)
    proportional, integral, derivative = VELOCITY_GAINS
    position, velocity, acceleration = rows[TRAJECTORY:CHANGES]
    error = POSITION_GAIN * (position - rows[_POSITION]) + velocity - rows[_VELOCITY]
    motion = rows[_THRUST] - DRAG * rows[_VELOCITY]
    demand = acceleration + proportional * error + rows[_INTEGRAL] - derivative * motion
    system = np.zeros((STATES, STATES))
    system[_POSITION] = rows[_VELOCITY]
    system[_VELOCITY] = motion
    system[_THRUST] = (demand - rows[_THRUST]) / ATTITUDE_LAG
    system[_INTEGRAL] = integral * error
    system[TRAJECTORY:CHANGES] = rows[CHANGES:]
    terms = [np.eye(STATES)]
    for k in range(1, 2 * _TERMS):
        terms.append(system @ terms[-1] / k)
    transition = sum(term * step**k for k, term in enumerate(terms))
    transition[:, CHANGES:] /= step
    return transition.astype(np.complex128), np.vstack(terms[:_TERMS]).astype(np.complex128)
