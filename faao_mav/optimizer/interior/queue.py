"""The relay's queue: what it delivers of two rates, instead of the smaller of their means.

    maximise  sum_n f_n    with  q_0 = 0,  q_{n+1} = q_n + r_n - f_n,  f_n <= q_n,  q_n <= buffer
    and  r_n <= x_n I_U(w_n),  f_n <= (1 - x_n) I_G(w_n),  0 <= x_n <= 1

for half duplex, and with r_n <= I_U(w_n), f_n <= I_G(w_n) for full duplex: see `radio.relay`. That
r and f are at least 0 need not be said: received less than nothing can be taken off an earlier
slot. In slot 0 nothing can be forwarded, and what the last slot receives is worth nothing.

Method. q_n, the multiplier p_n of its equation and x_n are unknowns of the Newton system. r_n and
f_n are eliminated slot by slot: with z the multipliers of the first three inequalities, which are
the worth of I_U, of I_G and of the queue,

    p_n = z_1,    1 - p_n = z_2 + z_3

so that p_n falls from slot to slot while the queue is the bottleneck. The rates are no linear
functions of w: by how much a step misses them stays as a margin, which the next step takes up.

Half duplex is bilinear in x and w, with the Hessian -(z_1 grad I_U - z_2 grad I_G) between them. It
is not definite: two slots that receive and forward in turn serve a flight that sways between the
stations. Newton's matrix has it as it is, a proximal term on x and w keeps the directions uphill.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.banded import Entry, W
from faao_mav.optimizer.interior.constraint import (
    Constraint,
    Forces,
    Move,
    ScaledFlight,
    Start,
    Stiffness,
    largest,
    summed,
)
from faao_mav.optimizer.interior.half_planes import Slacks
from faao_mav.optimizer.interior.rewards import ScaledRewards, StageValues
from faao_mav.optimizer.kinematics import LENGTH, Kinematics, Trajectory
from faao_mav.radio.relay import best_shares, forward_greedily

_LEAST_SHARE = 0.2
"""The best shares are mostly 0 and 1; a warm search starts from them this far inside. Chosen."""


class QueueRewards(ScaledRewards):
    """The unit of the rates; the objective is the queue's own."""

    def mean(self, total: Real) -> Real:
        """Return a sum of f as its mean over the slots, in the stage's unit."""
        return np.asarray(super().mean(total) - self.least)

    def scaled(self, values: StageValues) -> tuple[Real, Real, Real]:
        """Return rewards, gradients and Hessians of no links at all."""
        shape = values.value.shape[1:]
        return np.zeros((0, shape[0], 1)), np.zeros((2, 0, *shape)), np.zeros((3, 0, *shape))

    def __call__(self, w: Real) -> tuple[Real, Real, Real]:
        """Return the same at scaled w."""
        return self.scaled(StageValues(np.zeros((0, *w.shape[1:])), w, w))


@dataclass(frozen=True)
class Queue(Constraint):
    """The queue of a relay that shares its band if `half`; `buffer` is in the unit of the rates."""

    rewards: ScaledRewards
    half: bool = False
    buffer: float = math.inf

    @property
    def unknowns(self) -> int:
        """Return 2: q_n and p_n, or with shares 3: x_n too, the first."""
        return 3 if self.half else 2

    @property
    def bilinear(self) -> bool:
        """Return whether there are shares."""
        return self.half

    def entries(self, slots: int, first: int) -> Sequence[Entry]:
        """Return what the equations of the queue have of the next slot, and of the ends."""
        q, p = first + self.half, first + self.half + 1
        begins, ends = np.zeros((2, slots))
        begins[0] = ends[-1] = 1
        return (
            Entry(q, p, np.ones(slots - 1), ahead=1),
            Entry(q, q, begins),
            Entry(p, p, ends),
            # q_0 = 0 is fixed, which takes its place in the equation of q_1
        )

    def begin(self, flight: ScaledFlight, start: Start) -> "QueueState":  # noqa: ARG002
        """Return the state at `start`: what is forwarded greedily there, and slacks widened."""
        scaled = self.rewards.in_units(self.rewards.values)
        I_U, I_G = scaled.value
        x = self._shares(start)
        most = self.buffer / self.rewards.unit
        relayed = [
            forward_greedily(arriving, leaving, float(room[0]))
            for arriving, leaving, room in zip(
                x * I_U, (1 - x if self.half else x) * I_G, most, strict=True
            )
        ]
        r, f, q = (
            np.stack([getattr(each, part) for each in relayed])
            for part in ("received", "forwarded", "queue")
        )
        inner, outer = np.ones((2, *I_U.shape))
        inner[:, 0], outer[:, -1] = 0, 0
        on = [outer, inner, inner]
        if self.half:
            on += [np.ones(I_U.shape)] * 2
        if math.isfinite(self.buffer):
            on.append(inner)
        ones = np.stack(on)
        state = QueueState(
            ones, ones, ones, ones, self, start.own, most,
            scaled.value, scaled.gradient, scaled.hessian, r, f, q, 0.5 * outer, x,
        )  # fmt: skip
        functions = state.functions()
        s = np.where(state.on > 0, functions + 2 * start.mu, 1.0)
        state = replace(state, s=s, margin=np.where(state.on > 0, s - functions, 0.0))
        return state.centred(start.mu)

    def _shares(self, start: Start) -> Real:
        """Return the shares of receiving to start from, (flights, n): the best where it is warm."""
        rates = self.rewards.values.value
        if not self.half:
            return np.ones(rates.shape[1:])
        if start.margin >= 1:  # cold
            return np.full(rates.shape[1:], 0.5)
        best = [best_shares(I_U, I_G, self.buffer) for I_U, I_G in rates.swapaxes(0, 1)]
        return np.clip(best, _LEAST_SHARE, 1 - _LEAST_SHARE)

    def excess(self, kin: Kinematics, flight: Trajectory) -> float:  # noqa: ARG002
        """Return 0: every flight has a queue that keeps the limits."""
        return 0.0


@dataclass(frozen=True)
class QueueState(Slacks):
    """The queue at an iterate: slacks of x I_U - r, (1 - x) I_G - f, q - f, x, 1 - x, buffer - q.

    Those on x only with shares, the last only with a buffer. `margin` is by how much a slack is
    larger than its function. `values` (2, flights, n), `gradients` (2, 2, flights, n) and
    `hessians` (3, 2, flights, n) are those of both rates in the unit of the rewards, and r, f, q
    and `most` (flights, 1), the buffer, too. p is the worth of what is received, x the shares.
    """

    constraint: Queue
    own: slice
    most: Real
    values: Real
    gradients: Real
    hessians: Real
    r: Real
    f: Real
    q: Real
    p: Real
    x: Real

    @property
    def shares(self) -> Real:
        """The shares of both hops in a slot, (2, flights, n)."""
        return np.stack([self.x, 1 - self.x if self.constraint.half else self.x])

    def functions(self) -> Real:
        """Return what the slacks are of, (m, flights, n)."""
        x, (I_U, I_G) = self.x, self.shares * self.values
        found = [I_U - self.r, I_G - self.f, self.q - self.f]
        if self.constraint.half:
            found += [x, 1 - x]
        if math.isfinite(self.constraint.buffer):
            found.append(self.most - self.q)
        return np.stack(found)

    @cached_property
    def slot(self) -> "Slot":
        """What the elimination of r and f leaves."""
        k = self.on * self.z / self.s
        both = np.where(self.on[1] > 0, k[1] + k[2], 1.0)
        return Slot(
            k,
            self.on[1] * k[1] / both,
            self.on[1] * k[2] / both,
            self.on[1] * k[1] * k[2] / both,
            self.on[1] / both,
            self.on[0] / np.where(self.on[0] > 0, k[0], 1.0),
            self.shares * self.gradients,
        )

    def violation(self) -> Real:
        """Return the largest margin, or by how much an equation of the queue is missed."""
        return np.maximum(largest(self.margin), largest(self._missed()))

    def reward(self) -> Real:
        """Return the sum of f."""
        return summed(self.f)

    def steepness(self) -> Real:
        """Return the largest gradient of a slot's rates, weighted."""
        steep = np.abs(self.slot.gradients).max(axis=0) * self.z[:2]
        return np.asarray(steep.sum(axis=0).max(axis=-1, keepdims=True))

    def missing(self, share: Real, step: Any, then: "QueueState") -> Real:
        """Return by how much the rates fall short of their linear model, weighted."""
        missed = summed(then.z * (then.margin - (1 - share) * self.margin))
        return np.asarray(missed - share**2 / 2 * step[-1])

    def _missed(self) -> Real:
        """Return q_n + r_n - f_n - q_{n+1}, (flights, n), 0 for the last slot."""
        missed = np.zeros_like(self.q)
        missed[..., :-1] = (self.q + self.r - self.f)[..., :-1] - self.q[..., 1:]
        return missed

    def forces(self) -> Forces:
        """Return the forces of the multipliers, and the gradients by r, f, q and x."""
        z, p, (_, inner, _) = self.z, self.p, self.on[:3]
        on_q = p + z[2]
        on_q[..., 1:] -= p[..., :-1]
        if math.isfinite(self.constraint.buffer):
            on_q -= z[-1]
        own = [p - z[0], inner * (1 - p - z[1] - z[2]), inner * on_q]
        if self.constraint.half:
            own.append(z[0] * self.values[0] - z[1] * self.values[1] + z[3] - z[4])
        return Forces(w=(self.slot.gradients * z[:2]).sum(axis=1), own=np.stack(own, axis=-1))

    def stiffness(self) -> Stiffness:
        """Return what the slots' inequalities and equations have of w, x, q and p."""
        slot, (I_U, I_G) = self.slot, self.values
        g_U, g_G = slot.gradients[:, 0], slot.gradients[:, 1]
        x, (q, p) = self.own.start, (self.own.stop - 2, self.own.stop - 1)
        on_q, outer = slot.series, self.on[0]
        if math.isfinite(self.constraint.buffer):
            on_q = on_q + slot.k[-1]
        entries = [
            Entry(q, q, on_q),
            Entry(p, q, -slot.by_G * outer * self.on[1]),
            Entry(p, p, -slot.loose_r - slot.loose_f * outer),
        ]
        for axis in (0, 1):
            entries += [
                Entry(q, W.start + axis, -slot.series * g_G[axis]),
                Entry(p, W.start + axis, outer * (slot.by_G * g_G[axis] - g_U[axis])),
            ]
        if self.constraint.half:
            entries += [
                Entry(x, x, slot.series * I_G * I_G + slot.k[3] + slot.k[4]),
                Entry(q, x, slot.series * I_G),
                Entry(p, x, -outer * (I_U + slot.by_G * I_G)),
            ]
            crossed = self._crossed()
            entries += [
                Entry(x, W.start + axis, crossed[axis] - slot.series * I_G * g_G[axis])
                for axis in (0, 1)
            ]
        weighted = self.shares * self.z[:2]
        return Stiffness(
            w=slot.series * np.stack([g_G[0] * g_G[0], g_G[0] * g_G[1], g_G[1] * g_G[1]]),
            entries=entries,
            curvature=-(weighted * self.hessians).sum(axis=1),
            held=(x,) if self.constraint.half else (),
        )

    def _crossed(self) -> Real:
        """Return the Hessian of the Lagrangian by x and w, (2, flights, n)."""
        return np.asarray(self.z[1] * self.gradients[:, 1] - self.z[0] * self.gradients[:, 0])

    def _eliminated(
        self, m: Any, t: Any, p: Any, left: Any, risen: Any, dx: Any, dq: Any
    ) -> tuple[Real, Real, Real, Real]:
        """Return ds, the new z, and the changes of r and f, which the system leaves out.

        `m` are the margins, `t` the targets, `p` the worth of what is received and `left` 1 - p,
        `risen` (2, flights, n) the linear changes of both rates; 0 for what has no part.
        """
        slot, (outer, inner) = self.slot, self.on[:2]
        ds, z = np.zeros_like(self.s), np.zeros_like(self.s)
        ds[0] = slot.loose_r * (t[0] - p)
        apart = risen[1] - m[1] - dq + m[2]
        exchanged = slot.by_q * t[1] - slot.by_G * t[2] - slot.series * apart
        loose = slot.loose_f * (left - t[1] - t[2])
        ds[1], ds[2] = slot.by_q * apart - loose, -slot.by_G * apart - loose
        if self.constraint.half:
            ds[3], ds[4] = dx - m[3], -dx - m[4]
        if math.isfinite(self.constraint.buffer):
            ds[-1] = -inner * dq - m[-1]
        z[0], z[1], z[2] = p, slot.by_G * left + exchanged, slot.by_q * left - exchanged
        z[3:] = t[3:] - slot.k[3:] * ds[3:]
        dr = outer * (risen[0] - m[0] - ds[0])
        df = inner * (loose + slot.by_G * (risen[1] - m[1]) + slot.by_q * (dq - m[2]))
        return ds, z, dr, df

    def push(self, target: Real | None) -> Forces:
        """Return the forces and right-hand sides without a target, or what `target` adds."""
        none = np.zeros_like(self.s)
        if target is None:
            _, z, dr, df = self._eliminated(self.margin, none, 0.0, 1.0, none, 0.0, 0.0)
            dr = dr + self._missed()
        else:
            _, z, dr, df = self._eliminated(none, target, 0.0, 0.0, none, 0.0, 0.0)
        outer, inner = self.on[:2]
        on_q = z[2] - z[-1] if math.isfinite(self.constraint.buffer) else z[2]
        own = [inner * on_q, outer * (dr - df)]
        if self.constraint.half:
            own.insert(0, z[3] - z[4] - self.values[1] * z[1])
        return Forces(w=self.slot.gradients[:, 1] * z[1], own=np.stack(own, axis=-1))

    def target(self, mu: Real, ahead: Any, share: Real) -> Real:
        """Return (mu - ds dz) / s at `share` of the step `ahead`."""
        return super().target(mu, ahead[:2], share)

    def solved(self, move: Move, target: Real | None, rest: Forces) -> tuple[Any, Forces]:  # noqa: ARG002
        """Return the changes of slacks, multipliers, r, f, q, p and x along `move`.

        The last of the changes is the part of x and w in the curvature, (flights, 1).
        """
        own = move.unknowns[..., self.own].transpose(2, 0, 1)
        dx = own[0] if self.constraint.half else np.zeros_like(own[0])
        dq, p = self.on[1] * own[-2], self.on[0] * own[-1]
        risen = (self.slot.gradients * move.w[:, None]).sum(axis=0)
        if self.constraint.half:
            risen += np.stack([dx, -dx]) * self.values
        t = np.zeros_like(self.s) if target is None else target
        ds, z, dr, df = self._eliminated(self.margin, t, p, 1 - p, risen, dx, dq)
        force = Forces(w=(self.slot.gradients * z[:2]).sum(axis=1))
        crossed = 2 * summed((self._crossed() * move.w).sum(axis=0) * dx)
        return (ds, z - self.z, dr, df, dq, p - self.p, dx, crossed), force

    def curvature(self, step: Any) -> Real:
        """Return the sum of z / s ds^2, the margins left out, and of the part of x and w."""
        return np.asarray(super().curvature(step[:2]) + step[-1])

    def reach(self, step: Any) -> Real:
        """Return the share of `step` at which a slack or a multiplier vanishes."""
        return super().reach(step[:2])

    def moved(self, w: Real, v: Real, share: Real, step: Any) -> "QueueState":  # noqa: ARG002
        """Return the state after `share` of `step`, with the rates at w."""
        ds, dz, *changes, _ = step
        rewards = self.constraint.rewards
        rates = rewards.in_units(rewards.stage(w * LENGTH))
        names = ("r", "f", "q", "p", "x")
        now = {
            name: getattr(self, name) + share * change
            for name, change in zip(names, changes, strict=True)
        }
        then = replace(
            self, s=self.s + share * ds, z=self.z + share * dz,
            values=rates.value, gradients=rates.gradient, hessians=rates.hessian, **now,
        )  # fmt: skip
        return replace(then, margin=np.where(self.on > 0, then.s - then.functions(), 0.0))

    def centred(self, mu: Real) -> "QueueState":
        """Return the same slacks with z = mu / s."""
        return replace(self, z=mu * self.on / self.s)


@dataclass(frozen=True, slots=True)
class Slot:
    """The slots' own equations with r and f eliminated, (flights, n); `k` (m, ...) are z / s.

    Of k_2 = z_2 / s_2 and k_3 = z_3 / s_3: their shares `by_G` and `by_q` in k_2 + k_3, `series`
    k_2 k_3 / (k_2 + k_3) and `loose_f` 1 / (k_2 + k_3); `loose_r` is s_1 / z_1. `gradients`
    (2, 2, ...) are those of x I_U and (1 - x) I_G by w.
    """

    k: Real
    by_G: Real
    by_q: Real
    series: Real
    loose_f: Real
    loose_r: Real
    gradients: Real
