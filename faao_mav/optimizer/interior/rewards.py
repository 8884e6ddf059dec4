"""What a flight maximises: the smallest of the sums of some rewards of its slots, or a queue's."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from faao_mav.arrays import PACKED, Flags, Real
from faao_mav.optimizer.interior.constraint import TINY, Constraint, Grid, Rows, W
from faao_mav.optimizer.kinematics import LENGTH
from faao_mav.radio.relay import RelayQueue, best_shares, forward_greedily

_FLAT = 1e-9
"""A gain per 100 m, relative to the reward, that is not worth a detour. Chosen."""

_LEAST_SHARE = 0.2
"""The best shares are mostly 0 and 1; a warm search starts from them this far inside. Chosen."""


@dataclass(frozen=True, slots=True)
class StageValues:
    """f, its gradient (1/m) and its Hessian (1/m^2) as xx, xy, yy.

    (J, ..., n), (2, J, ..., n) and (3, J, ..., n).
    """

    value: Real
    gradient: Real
    hessian: Real


class Stage(Protocol):
    """The rewards f_jn of being at w_n, n = 0 .. N+1."""

    def __call__(self, w: Real, /) -> StageValues:
        """Return the rewards at w (2, ..., n), m; not-a-number where there is none."""


class Goal(Constraint):
    """What is maximised: the sum of one reward, or of what is forwarded of two rates.

        q_0 = 0,  q_{n+1} = q_n + r_n - f_n,  f_n <= q_n,  q_n <= buffer
        r_n <= x_n I_U(w_n),  f_n <= (1 - x_n) I_G(w_n),  0 <= x_n <= 1

    for half duplex, and with r_n <= I_U(w_n), f_n <= I_G(w_n) for full duplex: see `radio.relay`.
    That r and f are at least 0 need not be said: received less than nothing can be taken off an
    earlier slot. In slot 0 nothing can be forwarded, and what the last receives is worth nothing.
    For min(R_U, R_G), without a relay, more may be forwarded than was received before, not in all.

    Beside `of` it has the unknowns r, f, q and x of each slot. The objective is `slope` times these
    (own,); they keep `after` x_{n+1} = `before` x_n, (k, own). Of one reward there are none: its
    row is no inequality, but the objective.
    """

    of = W
    inside = 0.0
    headroom = 20.0  # measured: with 0.1 and with 2 two of 16 planes lose 1 to 3 %

    def __init__(
        self, stage: Stage, w: Real, relay: RelayQueue | None = None, time_step: float = 1.0
    ) -> None:
        self.stage, values = stage, stage(w)
        self.base = values.value
        first = self.base.mean(axis=-1, keepdims=True)
        steepest = np.abs(values.gradient).max(axis=(0, -1))[:, None] * LENGTH
        # an F_j far above the least one has no say in the unit
        above = np.maximum(steepest + first - first.min(axis=0), TINY)
        unit = float((steepest**2 / above).max())
        self.flat = not unit > _FLAT * np.abs(first).max()
        self.unit = 1.0 if self.flat else unit
        rounding = 2 * np.finfo(float).eps * np.abs(self.base).sum(axis=-1).max()
        self.noise = 1e-9 + rounding / self.unit
        self.causal, self.half = relay is not None, relay is not None and relay.half
        self.buffer = math.inf if relay is None else relay.buffer / time_step / self.unit
        hops = len(self.base)
        self.own = own = 0 if hops == 1 else 4 if self.half else 3
        self.held = (3,) if self.half else ()
        self.slope = np.array([0.0, 1.0, 0.0, 0.0])[:own]
        self.before = np.array([[1.0, -1.0, 1.0, 0.0]])[: hops - 1, :own]
        self.after = np.array([[0.0, 0.0, 1.0, 0.0]])[: hops - 1, :own]

    def begin(self, *, cold: bool) -> Real:
        """Return its unknowns (own, n) to begin with: what is forwarded greedily."""
        rates = self.base / self.unit
        if self.own == 0:
            return rates[:0]
        I_U, I_G = rates
        n, x = len(I_U), np.full(len(I_U), 0.5)
        if not self.causal:
            f = I_G - max(0.0, float(I_G.mean() - I_U.mean()))
            return np.stack([I_U, f, np.cumsum(I_U - f) - I_U + f])
        if self.half and not cold:
            x = np.clip(best_shares(I_U, I_G, self.buffer), _LEAST_SHARE, 1 - _LEAST_SHARE)
        come, gone = (x * I_U, (1 - x) * I_G) if self.half else (I_U, I_G)
        found = forward_greedily(come, gone, self.buffer)
        own = np.stack([found.received, found.forwarded, found.queue, x])[: self.own]
        return np.asarray(own * self.free(n))

    def free(self, slots: int) -> Flags:
        """Return which of its unknowns are not given, (own, `slots`)."""
        free = np.ones((self.own, slots), dtype=np.bool_)
        free[2:3, 0] = False
        if self.causal:
            free[1, 0] = free[0, -1] = False
        return free

    def rows(self, x: Real) -> Rows:
        """Return x I_U - r, (1 - x) I_G - f, q - f, and what is left of shares and buffer."""
        own, n = x[2:], x.shape[1]
        at = self.stage(x[:2] * LENGTH)
        rates = at.value / self.unit
        gradient = at.gradient.swapaxes(0, 1) * (LENGTH / self.unit)
        hessian = at.hessian[PACKED].transpose(2, 0, 1, 3) * (LENGTH**2 / self.unit)
        hops, half = len(rates), self.half
        if hops == 1:
            return Rows(rates, gradient, hessian)
        shares = np.stack([own[3], 1 - own[3]]) if half else np.ones((2, n))
        slope = np.zeros((6, 2 + self.own, n))
        bend = np.zeros((6, 2 + self.own, 2 + self.own, n))
        slope[:2, :2] = shares[:, None] * gradient
        bend[:2, :2, :2] = shares[:, None, None] * hessian
        come = 0.0 if self.causal else 1.0
        value = [*(shares * rates - own[:2]), own[2] - own[1] + come * own[0]]
        slope[0, 2] = slope[1, 3] = -1
        slope[2, 2:5] = np.array([[come], [-1.0], [1.0]])
        if math.isfinite(self.buffer):
            slope[len(value), 4] = -1
            value.append(self.buffer - own[2])
        if half:
            slope[0, 5], slope[1, 5] = rates[0], -rates[1]
            bend[0, 5, :2] = bend[0, :2, 5] = gradient[0]
            bend[1, 5, :2] = bend[1, :2, 5] = -gradient[1]
            slope[len(value), 5], slope[len(value) + 1, 5] = 1, -1
            value += [own[3], 1 - own[3]]
        m = len(value)
        return Rows(np.stack(value), slope[:m], bend[:m])

    def on(self, grid: Grid, rows: int) -> Flags:
        """Return where each row holds, (rows, n)."""
        on = np.full((rows, grid.slots), self.own > 0)
        if self.causal:
            on[0, -1] = on[1:3, 0] = False
        else:
            on[2:, :-1] = False
        if math.isfinite(self.buffer):
            on[3, 0] = False
        return on
