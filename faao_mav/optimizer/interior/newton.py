"""One Newton step of the interior-point method, by a banded LU and a border of J + 1.

From (w, v, t), constraints with multipliers z, slacks F - t with multipliers `weights`, and the
multipliers y of the motion, the step solves

    H dw + A_w^T y+ - G^T weights+ = forces of z+ on w     A (dw, dv) = -A (w, v)
    A_v^T y+ = forces of z+ on v and a                     z+ + K ds = mu s^-1 - correction
    G dw - dt + (F - t) weights+ / weights = mu c / weights     sum weights+ = 1

with + for new multipliers, H = -sum_j weights_j Hessian(F_j), G the gradients of the F_j, c the
share of the barrier that keeps t below the F_j, and K, ds, s of every constraint: see
`constraint`. Several flights take their steps side by side, each its own: see `iterate`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from faao_mav.arrays import Flags, Real
from faao_mav.optimizer.interior.banded import Entry, Factors, Q, V, W, Y
from faao_mav.optimizer.interior.constraint import (
    Forces,
    Move,
    ScaledFlight,
    Stiffness,
    added,
    positive_part,
    quadratic,
    summed,
)
from faao_mav.optimizer.interior.iterate import Direction, Iterate

_UNBOUNDED = np.array([1e20, 0.0, 1e20])[:, None, None]
"""The compliance of an acceleration without a limit: large enough that its force is nothing."""

_MIN_CURVATURE = 1e-8
"""The least curvature along a direction, per squared length, that counts as that of a minimum.

Chosen; what a change costs is not measured.
"""


@dataclass(frozen=True, slots=True)
class Newton:
    """The factored system at an iterate; `curvature` (3, flights, n) is H with its proximal term.

    `proximal` (flights, 1) is that term, which holds the places `held` of a slot's unknowns too.
    `turning` (3, flights, n) and `across` (2, 2, flights, n - 1) are what constraints curve on v_n,
    and between v_n and v_{n+1}: the share that leaves the model concave, with a proximal term.

    `columns` are the solutions for the gradients of the F_j, and for mu = 0 without correction;
    `border` (flights, J, J) is what the first ones leave for the weights.
    """

    flight: ScaledFlight
    at: Iterate
    barrier_share: float
    proximal: Real
    held: Sequence[int]
    curvature: Real
    turning: Real | float
    across: Real | float
    compliance: Real
    factors: Factors
    columns: Real
    border: Real

    @classmethod
    def factored(
        cls,
        flight: ScaledFlight,
        at: Iterate,
        *,
        barrier_share: float,
        proximal: Real,
        cut: Flags,
    ) -> "Newton":
        """Factor the system, with the negative part of H cut where `cut` (flights, 1)."""
        matrix, (links, flights) = flight.matrix, at.total.shape[:2]
        n = matrix.slots
        stiffness = [state.stiffness() for state in at.states]
        curvature = -np.einsum("jb,cjbn->cbn", at.weights[..., 0], at.hessian)
        curvature += added(each.curvature for each in stiffness)
        whole = curvature
        if cut.any():
            curvature = np.where(cut, positive_part(curvature), curvature)
        wrong = whole - curvature
        curvature[::2] += proximal
        compliance = np.empty((3, flights, n))  # the last slot has none
        compliance[..., :-1] = _compliance(stiffness)
        compliance[..., :-1] /= flight.gain**2
        if not flight.gains.all():
            compliance[..., :-1] = np.where(flight.gains > 0, compliance[..., :-1], _UNBOUNDED)
        held = [place for each in stiffness for place in each.held]
        entries = [entry for each in stiffness for entry in each.entries]
        entries += [Entry(place, place, np.repeat(proximal, n, axis=1)) for place in held]
        on_w = np.asarray(added([curvature, *(each.w for each in stiffness)]))
        on_v = np.asarray(added(each.v for each in stiffness))
        turning, across, between = (added(getattr(e, part) for e in stiffness) for part in _ON_V)
        if isinstance(turning, np.ndarray):
            stiff, wrong_parts = (on_w, on_v, between), (wrong, turning, across)
            share = _concave_share(flight, stiff, wrong_parts, compliance)
            on_w, curvature = on_w + share * wrong, curvature + share * wrong
            turning = share * turning
            turning[::2] += proximal
            on_v += turning
            across = share * across if isinstance(across, np.ndarray) else across
        coupled = added((across, between))
        if isinstance(coupled, np.ndarray):
            entries += [Entry(V.start + j, V.start + i, coupled[i, j], 1) for i, j in _PAIRS]
        factors = matrix.factor(
            on_w,
            on_v,
            compliance,
            entries,
        )

        right = np.zeros((links + 1, flights, n, matrix.size))
        right[:links, ..., W] = at.gradient.transpose(1, 2, 3, 0)
        _load(right[links], flight, compliance, [state.push(None) for state in at.states])
        ahead = matrix.dynamics(at.w, at.v)
        np.negative(ahead.transpose(1, 2, 0), out=right[links, :, :-1, Y])
        columns = factors.solve(right)

        border = np.einsum("cibn,jbnc->bij", at.gradient, columns[:links, ..., W])
        room = (at.total - at.floor) / at.weights
        border[:, range(links), range(links)] += room[..., 0].T
        return cls(
            flight,
            at,
            barrier_share,
            proximal,
            held,
            curvature,
            turning,
            across,
            compliance,
            factors,
            columns,
            border,
        )

    def looks_convex(self, direction: Direction) -> Flags:
        """Tell whether the systems look like those of minima, by two signs, (flights, 1)."""
        both = self.border + np.swapaxes(self.border, 1, 2)
        both = np.where(np.isfinite(both).all(axis=(1, 2), keepdims=True), both, 0.0)
        move = direction.move
        size = sum(np.einsum("cbn,cbn->b", x, x) for x in (move.w, move.v))
        falls = self.decrease(direction, self.bend(direction)) > _MIN_CURVATURE * size[:, None]
        return np.asarray((np.linalg.eigvalsh(both) > 0).all(axis=1, keepdims=True) & falls)

    def predictor(self) -> Direction:
        """Return the direction for mu = 0 without a correction."""
        return self._direction(self.columns[-1], np.zeros((1, 1)), (None,) * len(self.at.states))

    def corrector(self, mu: Real, ahead: Direction, share: Real) -> Direction:
        """Return the direction for mu (flights, 1), corrected by `share` of `ahead`."""
        steps = zip(self.at.states, ahead.steps, strict=True)
        return self.aimed(mu, tuple(state.target(mu, step, share) for state, step in steps))

    def aimed(self, mu: Real, targets: tuple[Any, ...]) -> Direction:
        """Return the direction for mu (flights, 1) and the `targets` of the constraints."""
        flight, states = self.flight, self.at.states
        right = np.zeros((1, self.at.w.shape[1], flight.matrix.slots, flight.matrix.size))
        pushes = [state.push(target) for state, target in zip(states, targets, strict=True)]
        _load(right[0], flight, self.compliance, pushes)
        return self._direction(self.columns[-1] + self.factors.solve(right)[0], mu, targets)

    def _direction(self, alone: Real, mu: Real, targets: tuple[Any, ...]) -> Direction:
        """Return the direction that is `alone` without the pull of the rewards."""
        at, flight = self.at, self.flight
        links, flights = at.total.shape[:2]
        # G dw - dt + (F - t) weights+ / weights = mu c / weights, and the weights sum to one
        system = np.ones((flights, links + 1, links + 1))
        system[:, :links, :links] = self.border
        system[:, :links, links], system[:, links, links] = -1, links == 0
        right = np.ones((flights, links + 1, 1))
        gained = np.einsum("cjbn,bnc->bj", at.gradient, alone[..., W])
        right[:, :links, 0] = (mu * self.barrier_share / at.weights)[..., 0].T - gained
        solved = np.linalg.solve(system, right).transpose(1, 0, 2)
        weights, floor = solved[:links], solved[links]
        unknowns = alone + np.einsum("jb,jbnk->bnk", weights[..., 0], self.columns[:links])

        dw, dv, q, y = (unknowns[..., part].transpose(2, 0, 1) for part in (W, V, Q, Y))
        q, y = q[..., :-1], y[..., :-1]
        on_a = q * flight.per_gain
        rest, move = Forces(v=flight.forces_asked(y, on_a), a=on_a), Move(dw, dv, unknowns)
        steps: list[Any] = []
        for state, target in zip(at.states[:0:-1], targets[:0:-1], strict=True):
            step, supplied = state.solved(move, target, rest)
            rest = rest.less(supplied)
            steps.append(step)
        steps.append(at.states[0].solved(move, targets[0], rest)[0])
        return Direction(
            move=move,
            y=y - at.y,
            steps=tuple(reversed(steps)),
            weights=weights - at.weights,
            total=np.einsum("cjbn,cbn->jb", at.gradient, dw)[..., None],
            floor=floor,
        )

    def bend(self, direction: Direction) -> Real:
        """Return dw^T H dw, and what the proximal term has of other unknowns, (flights, 1)."""
        own = direction.move.unknowns[..., self.held]
        others = (own * own).sum(axis=(1, 2))[:, None]
        return np.asarray(quadratic(self.curvature, direction.move.w) + self.proximal * others)

    def decrease(self, direction: Direction, bend: Real) -> Real:
        """Return the curvature of the whole model along a `direction` of `bend`, (flights, 1)."""
        at = self.at
        kink = at.weights / (at.total - at.floor) * (direction.total - direction.floor) ** 2
        dv = direction.move.v
        if isinstance(self.turning, np.ndarray):
            bend = bend + quadratic(self.turning, dv)
        if isinstance(self.across, np.ndarray):
            both = [self.across[i, j] * dv[i, :, :-1] * dv[j, :, 1:] for i, j in _PAIRS]
            bend = bend + 2 * summed(np.stack(both))
        of_constraints = [
            state.curvature(step) for state, step in zip(at.states, direction.steps, strict=True)
        ]
        return np.asarray(reduce(np.add, of_constraints, bend) + kink.sum(axis=0))


_ON_V = "turning", "across", "between"
_PAIRS = (0, 0), (0, 1), (1, 0), (1, 1)

_SHARES = (1.0, 0.75, 0.5, 0.25, 0.125, 0.0)
"""Shares of the curvature of the wrong sign that are tried. Chosen."""


def _concave_share(
    flight: ScaledFlight,
    stiff: tuple[Real, Real, Real | float],
    wrong: tuple[Real, Real, Real | float],
    compliance: Real,
) -> Real:
    """Return the largest share (flights, 1) of what is `wrong` with which the model is concave.

    `stiff` are the blocks on w and v and between v_n and v_{n+1}, `wrong` what more there is.
    """
    xx, xy, yy = compliance
    on_a = np.stack([yy, -xy, xx]) / (xx * yy - xy * xy)
    on_w, on_v, between = stiff
    share = np.full((on_w.shape[1], 1), _SHARES[0])
    for lower in _SHARES[1:]:
        more_w, more_v, across = (share * each for each in wrong)
        sound = flight.matrix.positive(on_w + more_w, on_v + more_v, on_a, between + across)
        if sound.all():
            break
        share = np.where(sound, share, lower)
    return share


def _load(right: Real, flight: ScaledFlight, compliance: Real, pushes: list[Forces]) -> None:
    """Enter what the forces `pushes` of the constraints make of the right-hand side."""
    matrix, total = flight.matrix, Forces.total(pushes)
    if isinstance(total.w, np.ndarray):
        right[..., W] = (total.w * matrix.moves_w).transpose(1, 2, 0)
    right[..., V] = (total.v * matrix.moves_v).transpose(1, 2, 0)
    x, y = flight.gains * total.a
    xx, xy, yy = compliance[..., :-1]
    right[:, :-1, Q.start] = xx * x + xy * y
    right[:, :-1, Q.start + 1] = xy * x + yy * y
    for push, own in zip(pushes, flight.own, strict=True):
        right[..., own] = push.own


def _compliance(stiffness: list[Stiffness]) -> Real:
    """Return the inverse of the whole stiffness on the accelerations, (3, flights, n - 1)."""
    acting = [each for each in stiffness if np.ndim(each.a)]
    if len(acting) == 1 and acting[0].compliance is not None:
        return acting[0].compliance
    xx, xy, yy = np.asarray(added(each.a for each in acting))
    return np.asarray(np.stack([yy, -xy, xx]) / (xx * yy - xy * xy))
