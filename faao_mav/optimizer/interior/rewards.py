"""What a flight maximises: the smallest of the sums of some rewards of its slots, or a queue's."""

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from faao_mav.arrays import PACKED, Flags, Real
from faao_mav.optimizer.interior.constraint import TINY, Constraint, Grid, Rows, W
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory
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
    """What is maximised, with the `own` unknowns per slot that it takes beside `of`.

    `slope` (own,) is the objective's. The unknowns of a slot and the next one keep
    `after` x_{n+1} = `before` x_n, both (k, own).
    """

    of = W
    inside = 0.0
    noise: float
    held: tuple[int, ...] = ()
    slope: Real = np.zeros(0)
    before: Real = np.zeros((0, 0))
    after: Real = np.zeros((0, 0))

    @abstractmethod
    def begin(self, *, cold: bool) -> Real:
        """Return its unknowns (own, n) to begin with."""

    def free(self, slots: int) -> Flags:
        """Return which of its unknowns are not given, (own, `slots`)."""
        return np.ones((len(self.slope), slots), dtype=np.bool_)

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:  # noqa: ARG002
        """Return 0: every flight has its rewards."""
        return 0.0


class Rewards(Goal):
    """min_j F_j, the sums of `stage` over the slots, relative to a start: small gains keep digits.

    The unit is the largest gradient at the start w (2, n), m. `flat` tells that there is none.
    """

    total = True
    headroom = 0.0

    def __init__(self, stage: Stage, w: Real) -> None:
        self.stage, self.values = stage, stage(w)
        self.base = self.values.value
        first = self.base.mean(axis=-1, keepdims=True)
        steepest = np.abs(self.values.gradient).max(axis=(0, -1))[:, None] * LENGTH
        self.above = first - first.min(axis=0)
        # an F_j far above the least one has no say in the unit
        unit = float((steepest**2 / np.maximum(steepest + self.above, TINY)).max())
        self.flat = not unit > _FLAT * np.abs(first).max()
        self.unit = 1.0 if self.flat else unit
        rounding = 2 * np.finfo(float).eps * np.abs(self.base).sum(axis=-1).max()
        self.noise = 1e-9 + rounding / self.unit

    def begin(self, *, cold: bool) -> Real:  # noqa: ARG002
        """Return no unknowns."""
        return np.zeros((0, self.base.shape[-1]))

    def scaled(self, w: Real, base: Real | float = 0.0) -> tuple[Real, Real, Real]:
        """Return rewards above `base` at scaled w (2, n), with derivatives as `Rows` has them."""
        at = self.stage(w * LENGTH)
        return (
            (at.value - base) / self.unit,
            at.gradient.swapaxes(0, 1) * (LENGTH / self.unit),
            at.hessian[PACKED].transpose(2, 0, 1, 3) * (LENGTH**2 / self.unit),
        )

    def rows(self, x: Real) -> Rows:
        """Return the rewards relative to those of the start."""
        return Rows(*self.scaled(x, self.base - self.above))


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
