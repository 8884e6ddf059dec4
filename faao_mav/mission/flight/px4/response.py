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
_TRAJECTORY = 4
"""First of the trajectory's position, velocity, acceleration; their rates of change follow."""

STATES = 10
_TERMS = 12


class Response:
    """A cascaded position and velocity controller about an aircraft with lag and drag.

    State columns are `STATES` long: the aircraft's position, velocity, thrust over mass and
    velocity integral; the trajectory's position, velocity and acceleration; and the rates at which
    those change over the step. Horizontal columns are complex, vertical ones real: altitude is
    taken to be held as tightly as position. The system is linear, so a step of `step` seconds is
    one product; shorter ones sum the exponential's series.
    """

    def __init__(self, step: float) -> None:
        self._step = step
        self._system, self._transition = _matrices(step)

    def advance(self, state: Complex, dt: Real) -> Complex:
        """Return `state` (STATES, ...) after `dt` (...) seconds, each at most the step."""
        after = (self._transition @ state.reshape(STATES, -1)).reshape(state.shape)
        short = dt < self._step
        if short.any():
            term = state[:, short]
            part = term.copy()
            for k in range(1, _TERMS):
                term = self._system @ term * (dt[short] / k)
                part += term
            after[:, short] = part
        return after


@lru_cache(maxsize=8)
def _matrices(step: float) -> tuple[Complex, Complex]:
    """Return the system matrix A and exp(A step)."""
    rows = np.eye(STATES)
    proportional, integral, derivative = VELOCITY_GAINS
    position, velocity, acceleration = rows[_TRAJECTORY : _TRAJECTORY + 3]
    error = POSITION_GAIN * (position - rows[_POSITION]) + velocity - rows[_VELOCITY]
    motion = rows[_THRUST] - DRAG * rows[_VELOCITY]
    demand = acceleration + proportional * error + rows[_INTEGRAL] - derivative * motion
    system = np.zeros((STATES, STATES))
    system[_POSITION] = rows[_VELOCITY]
    system[_VELOCITY] = motion
    system[_THRUST] = (demand - rows[_THRUST]) / ATTITUDE_LAG
    system[_INTEGRAL] = integral * error
    system[_TRAJECTORY : _TRAJECTORY + 3] = rows[_TRAJECTORY + 3 :]
    term = transition = np.eye(STATES)
    for k in range(1, 2 * _TERMS):
        term = system @ term * (step / k)
        transition = transition + term
    return system.astype(np.complex128), transition.astype(np.complex128)
