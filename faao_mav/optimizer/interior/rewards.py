"""What a flight maximises: what a relay forwards of the rewards of both hops, slot by slot."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.interior.constraint import (
    COMMON,
    TINY,
    Constraint,
    Grid,
    Rows,
    StartStrategy,
    W,
)
from faao_mav.optimizer.kinematics import LENGTH
from faao_mav.radio.relay import RelayQueue, best_shares, forward_greedily

_FLAT = 1e-9
"""A gain per 100 m, relative to the reward, that is not worth a detour. Chosen."""

_LEAST_SHARE = 0.2
"""The best shares are mostly 0 and 1; a warm search starts from them this far inside. Chosen."""

_PACKED = np.array([[0, 1], [1, 2]])


@dataclass(frozen=True, slots=True)
class StageValues:
    """f, its gradient (1/m) and its Hessian (1/m^2) as xx, xy, yy.

    (2, ..., n), (2, 2, ..., n) and (3, 2, ..., n), the axis of both hops before the dots.
    """

    value: Real
    gradient: Real
    hessian: Real


class Stage(Protocol):
    """The rewards I_U, I_G of being at w_n, n = 0 .. N+1."""

    def __call__(self, w: Real, /) -> StageValues:
        """Return the rewards at w (2, ..., n), m; not-a-number where there is none."""


class Goal(Protocol):
    """What is maximised: the sum over the slots of what `worth` returns, with a rounding `noise`.

    `held` are the unknowns, beside positions and speeds, that the proximal term holds.
    """

    noise: float
    held: tuple[int, ...]

    def worth(self, x: Real) -> Rows:
        """Return one row of the unknowns x (k, n) of a slot."""


class Delivered(Constraint):
    """sum_n f_n of what is forwarded of what was received of two rewards.

        q_0 = 0,   q_{n+1} = q_n + r_n - f_n,   r_n <= I_U(w_n),   f_n <= I_G(w_n)

    With a `relay` f_n <= q_n <= buffer, and in half duplex, with shares 0 <= x_n <= 1 of a slot,
    r_n <= x_n I_U(w_n) and f_n <= (1 - x_n) I_G(w_n): see `radio.relay`. That r and f are at least
    0 need not be said: received less than nothing can be taken off an earlier slot. In slot 0
    nothing can be forwarded, and what the last receives is worth nothing.

    Without one all that counts is that no more was forwarded than received in the end: the smaller
    of both sums. r and f are then those above the rewards of the start: small gains keep digits.

    The unit is the largest gradient at the start w (2, n), m. `flat` tells that there is none.
    """

    of = W
    inside = 0.0

    def __init__(self, stage: Stage, w: Real, relay: RelayQueue | None, time_step: float) -> None:
        self.stage, self.relay, self.start = stage, relay, stage(w).value
        gradient = np.abs(stage(w).gradient)
        first = self.start.mean(axis=-1, keepdims=True)
        steepest = gradient.max(axis=(0, -1))[:, None] * LENGTH
        # a sum far above the other one has no say in the unit
        above = first - first.min(axis=0)
        unit = float((steepest**2 / np.maximum(steepest + above, TINY)).max())
        self.flat = not unit > _FLAT * np.abs(first).max()
        self.unit = 1.0 if self.flat else unit
        rounding = 2 * np.finfo(float).eps * np.abs(self.start).sum(axis=-1).max()
        self.noise = 1e-9 + rounding / self.unit
        # twice the mu of a cold start: what is received begins at half its worth
        self.headroom = 20.0 if relay else TINY
        self.half = relay is not None and relay.half
        self.buffer = math.inf if relay is None else relay.buffer / time_step / self.unit
        self.base = np.zeros((2, 1)) if relay else self.start
        self.ahead = 0.0 if relay else float(np.subtract(*self.start.sum(axis=-1))) / self.unit
        self.own = 4 if self.half else 3
        self.held: tuple[int, ...] = (COMMON + 3,) if self.half else ()
        self.after = np.eye(1, self.own)
        self.before = np.array([[1.0, 1.0, -1.0, 0.0]])[:, : self.own]

    def begin(self, x: Real, strategy: StartStrategy) -> Real:
        """Return q, r, f and the shares: what is forwarded greedily."""
        n = x.shape[1]
        if self.relay is None:
            # multipliers z_U, z_G of both rewards that sum to one, with slacks mu / z
            mu, d = strategy.mu, self.ahead / (n * strategy.mu)
            slack_U, slack_G = ((2 + d + np.hypot(d, 2)) * mu / 2 for d in (d, -d))
            r, f = -slack_U, -slack_G - slack_U / n
            return np.stack([(r - f) * np.arange(n), np.full(n, r), np.full(n, f)])
        I_U, I_G = self.start / self.unit
        x = np.full(n, 0.5) if self.half else np.ones(n)
        if self.half and strategy.room < 1:
            x = best_shares(self.start[0], self.start[1], self.buffer * self.unit)
            x = np.clip(x, _LEAST_SHARE, 1 - _LEAST_SHARE)
        found = forward_greedily(x * I_U, (1 - x if self.half else x) * I_G, self.buffer)
        own = np.stack([found.queue, found.received, found.forwarded, x])[: self.own]
        return np.asarray(own * self.free(n))

    def free(self, slots: int) -> Flags:
        """Return which unknowns are not given."""
        free = super().free(slots)
        free[0, 0] = False
        if self.relay is not None:
            free[2, 0] = free[1, -1] = False
        return free

    def worth(self, x: Real) -> Rows:
        """Return f_n; x begins with w, v, a, q, r and f."""
        slope = np.zeros((1, *x.shape))
        slope[0, COMMON + 2] = 1
        return Rows(x[None, COMMON + 2], slope)

    def rows(self, x: Real) -> Rows:
        """Return what is left of both rewards, of the queue, and of buffer and shares."""
        (q, r, f), n = x[2:5], x.shape[1]
        at, last = self.stage(x[:2] * LENGTH), np.arange(n) == n - 1
        I_U, I_G = (at.value - self.base) / self.unit
        gradient = at.gradient.swapaxes(0, 1) * (LENGTH / self.unit)
        hessian = at.hessian[_PACKED].transpose(2, 0, 1, 3) * (LENGTH**2 / self.unit)
        shares = np.stack([x[5], 1 - x[5]]) if self.half else np.ones((2, n))
        value = [shares[0] * I_U - r, shares[1] * I_G - f, q + r * last - f + self.ahead]
        slope = np.zeros((6, 2 + self.own, n))
        bend = np.zeros((6, 2 + self.own, 2 + self.own, n))
        slope[:2, :2] = shares[:, None] * gradient
        bend[:2, :2, :2] = shares[:, None, None] * hessian
        slope[0, 3] = slope[1, 4] = slope[2, 4] = -1
        slope[2, 2], slope[2, 3] = 1, last
        if math.isfinite(self.buffer):
            slope[len(value), 2] = -1
            value.append(self.buffer - q)
        if self.half:
            slope[0, 5], slope[1, 5] = I_U, -I_G
            bend[0, 5, :2] = bend[0, :2, 5] = gradient[0]
            bend[1, 5, :2] = bend[1, :2, 5] = -gradient[1]
            slope[len(value), 5], slope[len(value) + 1, 5] = 1, -1
            value += [x[5], 1 - x[5]]
        m = len(value)
        return Rows(np.stack(value), slope[:m], bend[:m])

    def on(self, grid: Grid, rows: int) -> Flags:
        """Return where each row holds, (rows, n)."""
        on = np.ones((rows, grid.slots), dtype=np.bool_)
        if self.relay is None:
            on[2, :-1] = False
            return on
        on[0, -1] = on[1:3, 0] = False
        if math.isfinite(self.buffer):
            on[3, 0] = False
        return on
