"""What a relay's queue delivers of two rates, as a goal."""

import math

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.interior.constraint import Grid, Rows
from faao_mav.optimizer.interior.rewards import Goal, Rewards
from faao_mav.radio.relay import RelayQueue, best_shares, forward_greedily

_LEAST_SHARE = 0.2
"""The best shares are mostly 0 and 1; a warm search starts from them this far inside. Chosen."""


class Queue(Goal):
    """sum_n f_n of what a relay forwards of two rates.

        q_0 = 0,  q_{n+1} = q_n + r_n - f_n,  f_n <= q_n,  q_n <= buffer
        r_n <= x_n I_U(w_n),  f_n <= (1 - x_n) I_G(w_n),  0 <= x_n <= 1

    for half duplex, and with r_n <= I_U(w_n), f_n <= I_G(w_n) for full duplex: see `radio.relay`.
    That r and f are at least 0 need not be said: received less than nothing can be taken off an
    earlier slot. In slot 0 nothing can be forwarded, and what the last receives is worth nothing.
    """

    headroom = 20.0  # measured: with 0.1 and with 2 two of 16 planes lose 1 to 3 %

    def __init__(self, rewards: Rewards, relay: RelayQueue, time_step: float) -> None:
        self.rewards, self.relay = rewards, relay
        self.noise = rewards.noise
        self.buffer = relay.buffer / time_step / rewards.unit
        self.own = 4 if relay.half else 3
        self.held = (3,) if relay.half else ()
        self.slope = np.eye(self.own)[2]
        self.after = np.eye(1, self.own)
        self.before = np.array([[1.0, 1.0, -1.0, 0.0]])[:, : self.own]

    def begin(self, *, cold: bool) -> Real:
        """Return q, r, f and x: what is forwarded greedily."""
        rates = self.rewards.base
        I_U, I_G = rates / self.rewards.unit
        n = len(I_U)
        x = np.full(n, 0.5) if self.relay.half else np.ones(n)
        if self.relay.half and not cold:
            room = self.buffer * self.rewards.unit
            x = np.clip(best_shares(rates[0], rates[1], room), _LEAST_SHARE, 1 - _LEAST_SHARE)
        found = forward_greedily(x * I_U, (1 - x if self.relay.half else x) * I_G, self.buffer)
        own = np.stack([found.queue, found.received, found.forwarded, x])[: self.own]
        return np.asarray(own * self.free(n))

    def free(self, slots: int) -> Flags:
        """Return which unknowns are not given: q_0 = f_0 = 0, and the last r is worth nothing."""
        free = super().free(slots)
        free[[0, 2], 0] = free[1, -1] = False
        return free

    def rows(self, x: Real) -> Rows:
        """Return x I_U - r, (1 - x) I_G - f, q - f, and what is left of shares and buffer."""
        (q, r, f), n = x[2:5], x.shape[1]
        (I_U, I_G), gradient, hessian = self.rewards.scaled(x[:2])
        shares = np.stack([x[5], 1 - x[5]]) if self.relay.half else np.ones((2, n))
        value = [shares[0] * I_U - r, shares[1] * I_G - f, q - f]
        slope = np.zeros((6, 2 + self.own, n))
        bend = np.zeros((6, 2 + self.own, 2 + self.own, n))
        slope[:2, :2] = shares[:, None] * gradient
        bend[:2, :2, :2] = shares[:, None, None] * hessian
        slope[0, 3] = slope[1, 4] = slope[2, 4] = -1
        slope[2, 2] = 1
        if math.isfinite(self.buffer):
            slope[len(value), 2] = -1
            value.append(self.buffer - q)
        if self.relay.half:
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
        on[0, -1] = on[1:3, 0] = False
        if math.isfinite(self.buffer):
            on[3, 0] = False
        return on
