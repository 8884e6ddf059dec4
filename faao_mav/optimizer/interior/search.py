"""The iteration of the interior-point method.

Lifecycle: `Search(...)` once, from a start; `run` iterates. An iteration measures the residual,
lowers the barrier parameter mu where the iterate has come near to its optimum and tries the Newton
direction. One that is refused is tried anew with a proximal term; iterates that hug the limits are
given multipliers from a larger mu.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.interior.constraint import TINY, Constraint, Grid, V
from faao_mav.optimizer.interior.newton import Direction, Iterate, System, newton_direction
from faao_mav.optimizer.interior.rewards import Goal
from faao_mav.optimizer.kinematics import Kinematics

_TO_BOUNDARY = 0.99
"""The share of the way to the boundary that a step may go. Chosen."""

_MISFIT = 0.25
"""The shortfall allowed, in shares of the model's decrease. Chosen."""

_SHORT, _PATIENCE = 0.1, 4
"""Steps below this share of the direction are short, and so many in a row are hugging. Chosen."""

_CENTRING, _MAX_CENTRINGS, _MAX_ATTEMPTS = 10.0, 8, 6
"""mu after a centring, in mean gaps before it; the centrings after which a search ends, and the
directions tried at one iterate before. Measured on five hard random plans: with 100 in place of 10
one does not converge, and one loses 8 %."""

_FIRST_PROXIMAL, _MORE_PROXIMAL = 1e-3, 8.0
"""The first proximal term, and by how much the next one is larger. Chosen."""

_FALL = 0.2
"""mu falls to this share when the scaled gradient is below mu. Measured on nine random plans with a
least speed: where it has to be below 3 or 10 mu, one or four do not converge."""

_LEAST_GAP = 0.25
"""The complementarity gap per slot at the least mu, in tolerances. Chosen."""

_MOST_MISSED = 0.2
"""What a step may miss of a limit in second order, where its slack is less. Without it two of 31
flights do not converge, in 30 % more iterations; with 0.3 one of three hard planes is 1 % worse."""

_LEFT = 0.1
"""The share of a linear slack that a half-plane which turns leaves at least, by a wider margin:
where an obstacle's nearest side changes, g may be below 0 after a step that ends above. Chosen."""


COLD, SLOW, WARM = 10.0, 0.1, 1e-2
"""The first barrier parameter mu of any start, from which the optimum may be far away; of one with
a least speed, where what turns where is not to be forgotten; and of one that is nearly optimal."""

_WARM_ROOM = 0.03
"""The share of the `headroom` that nearly optimal starts are given. Chosen."""


class Search:
    """A search from the unknowns w, v, a (6, n) of a start, in solver units.

    `v` (2, n) are the velocities of the best iterate that keeps the limits, `residual` that of the
    last one, `iterations` how many there were.
    """

    def __init__(
        self,
        kin: Kinematics,
        constraints: Sequence[Constraint],
        goal: Goal,
        x: Real,
        *,
        tolerance: float,
        mu: float,
    ) -> None:
        """Begin at x with the barrier parameter `mu`, `WARM` where x is nearly optimal."""
        self.goal, self.tolerance, self.mu = goal, tolerance, mu
        x = np.concatenate([x, goal.begin(cold=mu > WARM)])
        self.system = system = System(Grid.of(kin), goal, constraints, x)
        at = system.at(x)
        s = np.maximum(at.values, (1.0 if mu > WARM else _WARM_ROOM) * system.headroom)
        y = np.zeros((len(system.chain.after), kin.slots - 1))
        self.iterate = Iterate(at, y, s, self.mu / s, s - at.values)
        self.proximal, self.steepness = 0.0, 1.0
        self.iterations = self.attempts = self.short = self.centrings = 0
        self.best, self.v, self.residual = -np.inf, x[list(V)], np.inf

    def run(self, max_iterations: int) -> bool:
        """Iterate until the search has ended, and return whether it has converged."""
        while True:
            slope, residual = self._measure()
            lost = self.iterations >= max_iterations or self.centrings > _MAX_CENTRINGS
            # not finite: the limits have no interior left
            self.residual = residual if np.isfinite(residual) else np.inf
            if residual < self.tolerance or not np.isfinite(residual):
                return bool(residual < self.tolerance)
            if lost and not self.attempts:
                return False
            self._advance(slope)

    def _measure(self) -> tuple[float, float]:
        """Return the scaled gradient of the Lagrangian and the residual; note the best iterate."""
        system, it = self.system, self.iterate
        at, n = it.at, it.at.x.shape[1]
        gradient = system.objective + system.pull(at, it.z) - system.chain.pull(it.y)
        slope, gap = float(np.abs(gradient).max()), float((it.s * it.z).sum())
        slope /= max(1.0, float(it.z.sum() + np.abs(it.y).sum()) / (80 * n))
        # what is missed in second order counts tenfold
        broken = 10 * float((system.each * np.abs(it.margin)).max())
        broken = max(broken, float(np.abs(system.chain.missed(at.x)).max()))
        value = float((system.objective * at.x).sum()) + system.reward(at)
        kept = broken < self.tolerance
        if (kept and value > self.best) or self.best == -np.inf:
            self.best, self.v = value if kept else -np.inf, at.x[list(V)]
        # where the rewards are steeper than at the start, their unit is larger
        self.steepness = max(1.0, system.steepness(at, it.z))
        slope, gap = slope / self.steepness, gap / self.steepness
        return slope, max(slope, broken, gap / n)

    def _advance(self, slope: float) -> None:
        """Try one direction; a refused one is tried anew with a proximal term."""
        fresh = self.attempts == 0
        self.iterations += fresh
        share = 0.0
        try:
            self._lower_mu(slope)
            proximal = self.proximal * self.steepness
            direction = newton_direction(self.system, self.iterate, self.mu, proximal)
        except np.linalg.LinAlgError:
            self.attempts = _MAX_ATTEMPTS
        else:
            share = self._share(direction)
            if not self._accept(direction, share):
                share = share / 2 if self._accept(direction, share / 2) else 0.0
            # short steps of shares of the band lead to saddles: they are held back more
            if share == 0 or (share < _SHORT and self.goal.held):
                self.proximal = max(_MORE_PROXIMAL * self.proximal, _FIRST_PROXIMAL)
            elif fresh:
                self.proximal = self.proximal / 4 if self.proximal > _FIRST_PROXIMAL else 0.0
            self.attempts = 0 if share > 0 else self.attempts + 1
            if share > 0:
                self.short = self.short + 1 if share < _SHORT else 0
        hugging = self.short >= _PATIENCE and self.centrings < _MAX_CENTRINGS
        if self.attempts >= _MAX_ATTEMPTS or hugging:
            self._centre()

    def _share(self, step: Direction) -> float:
        """Return how far of `step` to go: inside the limits, as far as they are modelled."""
        it = self.iterate
        falls = max(float((-step.s / it.s).max()), float((-step.z / it.z).max()), TINY)
        bent = np.abs(self.system.bent(it.at, step.x))
        missed = max(float((bent / np.maximum(it.s, _MOST_MISSED)).max()), TINY)
        return float(min(1.0, _TO_BOUNDARY / falls, 1 / np.sqrt(missed)))

    def _lower_mu(self, slope: float) -> None:
        """Lower mu where the scaled gradient `slope` tells that the iterate is near its optimum."""
        solved = slope * self.steepness < self.mu or slope < self.tolerance
        per_slot = len(self.iterate.s) / self.iterate.at.x.shape[1]
        least = self.tolerance * _LEAST_GAP * self.steepness / per_slot
        self.mu = max(self.mu * (_FALL if solved else 1.0), least)

    def _accept(self, step: Direction, share: float) -> bool:
        """Move unless the functions fall short of the model."""
        system, it = self.system, self.iterate
        if not np.isfinite(step.x).all():
            return False
        at = system.at(it.at.x + share * step.x)
        if not np.isfinite(at.values.sum() + at.slopes.sum()):
            return False
        s, z = it.s + share * step.s, it.z + share * step.z
        margin = s - at.values
        more = z * (margin - (1 - share) * it.margin)
        missing = float(more[~system.turns].sum()) + system.reward(it.at) - system.reward(at)
        missing += share * float((system.pull(it.at, 0 * it.z) * step.x).sum())
        decrease = step.bend + float((it.z / it.s * (step.s + it.margin) ** 2).sum())
        missing -= share**2 / 2 * step.bend
        if not decrease > 0 or missing > _MISFIT * share * decrease + self.goal.noise:
            return False
        # half-planes that turn: what they leave is the slack, but for the margin that is left
        left = np.maximum((1 - share) * it.margin, _LEFT * s - at.values)
        margin = np.where(system.turns, left, margin)
        s = np.where(system.turns, at.values + left, s)
        y = it.y + (1.0 if self.iterations == 1 else share) * step.y
        self.iterate = Iterate(at, y, s, z, margin)
        return True

    def _centre(self) -> None:
        """Give the iterate multipliers from a larger mu: that leads away from limits."""
        it = self.iterate
        self.mu = min(COLD * self.steepness, _CENTRING * float(it.s @ it.z) / len(it.s))
        self.iterate = replace(it, z=self.mu / it.s)
        self.proximal, self.attempts, self.short = 0.0, 0, 0
        self.centrings += 1
