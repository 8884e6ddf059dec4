"""The most data that an energy lets be delivered, in any duration up to the plan's.

The data D(T, E) of the best flight of duration T within the energy E rises with E. Along T it rises
while there is energy to spare and falls where it is short, to nothing at E = T min P. One search
over T finds its maximum: each step improves the last step's flight, roughly. The flight of the best
T is then optimised from all starts. Energies are those of flight and relay, J.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.design import design
from faao_mav.optimizer.direct import ROUGH, direct
from faao_mav.optimizer.interior.constraint import Constraint
from faao_mav.optimizer.interior.maximize import (
    LocalOptimum,
    constraints_of,
    feasible,
    maximize,
)
from faao_mav.optimizer.interior.search import NEAR_START
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.problem import Problem, build_problem
from faao_mav.optimizer.rates.field import rate_field
from faao_mav.optimizer.search.multistart import stretched
from faao_mav.optimizer.search.sparing import sparing_starts
from faao_mav.optimizer.search.starts import straight_flight
from faao_mav.optimizer.search.track import nearest_flight
from faao_mav.optimizer.solution import Least, Observer, Progress, Solution, staged
from faao_mav.plan import Plan
from faao_mav.plan.checks import fewest_slots
from faao_mav.power import JOULES_PER_WH

_PRECISION = 0.01
"""The share of the longest duration to which the best one is looked for. Chosen."""

_NEAREST, _NEAR = 0.03, 0.15
"""The least and the largest share by which durations are tried on both sides of that of a near
energy: in between twice the share by which the energies differ. Chosen."""

_BETTER = 1e-3
"""The share of data by which a flight from other starts has to be better to look for its duration
anew. Chosen: the precision of a rough search is some ten times that."""

_STRAIGHT = 50
"""Durations of straight flights that are compared. Chosen."""

_SPEEDS, _PRICES = 500, 50
"""Airspeeds, and prices of speed, for which the least power is looked for. Chosen."""

_ABOVE = 1e-4
"""The share by which an energy is above what a flight takes that is a start. Chosen: ten times what
the search leaves unused."""

_STILL = 1e-9
"""The least difference of speeds that is divided by, m/s: rounding."""

_TRIES = 8
"""Durations that are tried from all starts where the last flight leads to none. Chosen."""


def most_data(plan: Plan, *, observe: Observer | None = None) -> Solution:
    """Return the solution of `plan` with the duration of most data within `goal.energy_wh`.

    Raises `InfeasibleError` where no flight was found that takes so little.
    """
    within = WithinEnergy(plan, observe)
    assert plan.goal.energy_wh is not None
    energy = JOULES_PER_WH * plan.goal.energy_wh
    best = within.unlimited
    if within.unlimited_energy > energy:
        best = within.ended(within.best(energy), energy)
    return replace(best, least=Least(plan.flight.duration, None, within.optimizations))


class WithinEnergy:
    """Flights of most data within an energy, from that of `plan` without such a limit on.

    `last` is the last one that was found, `optimizations` how many were optimised.
    """

    def __init__(self, plan: Plan, observe: Observer | None) -> None:
        self.plan, self.observe, self.optimizations = plan, observe, 0
        self.slots = np.arange(fewest_slots(plan), plan.flight.slots + 1)
        self.least = least_energies(plan, self.slots)
        self.unlimited = self._solved(plan.flight.slots, math.inf)
        self.unlimited_energy = self._energy(self.unlimited)
        self.last, self.near = self.unlimited.trajectory, 0.0
        problem = build_problem(plan)
        self.field = rate_field(problem, design(plan))  # which covers the shorter flights too

    @cached_property
    def straight(self) -> tuple[float, float]:
        """The duration, s, and energy, J, of the straight flight that takes the least."""
        return thriftiest_straight(self.plan)

    def best(self, energy: float) -> Solution:
        """Return the flight of most data, or where a rate is asked for of the highest rate.

        Raises `InfeasibleError` where none was found.
        """
        from scipy.optimize import minimize_scalar

        possible = self.slots[self.least <= energy]
        if not possible.size:
            raise InfeasibleError(self._too_little(energy))
        low, high = possible[[0, -1]].tolist()
        if self.near:
            centre = len(self.last.w) * energy / self.near
            aside = min(max(_NEAREST, 2 * abs(energy / self.near - 1)), _NEAR)
            low, high = max(low, int((1 - aside) * centre)), min(high, int((1 + aside) * centre))
        found: dict[int, LocalOptimum | None] = {}

        def missed(slots: float) -> float:
            n = round(slots)
            if n not in found:
                optimum = self._rough(n, energy)
                most = max((self._worth(k, each) for k, each in found.items()), default=0.0)
                if optimum is not None and self._worth(n, optimum) > most:
                    self.last = optimum.trajectory  # one from the straight start may be far worse
                found[n] = optimum
            return -self._worth(n, found[n])

        if high > low:
            step = max(0.5, _PRECISION * high)
            minimize_scalar(missed, bounds=(low, high), method="bounded", options={"xatol": step})
        elif high == low:
            missed(low)
        slots = max(found, key=lambda n: self._worth(n, found[n]), default=0)
        optimum = found.get(slots)
        best = (
            self._from_all_starts(energy, possible)
            if optimum is None
            else self._solved(slots, energy, optimum.trajectory, alone=True)
        )
        self.last, self.near = best.trajectory, energy
        return best

    def ended(self, best: Solution, energy: float) -> Solution:
        """Return the flight of the duration of `best` from all starts."""
        whole = self._solved(len(best.w), energy, best.trajectory)
        if whole.delivered_rate > (1 + _BETTER) * best.delivered_rate:
            self.last = whole.trajectory
            return max(whole, self.best(energy), key=self._data)
        return max(whole, best, key=self._data)

    def _rough(self, slots: int, energy: float) -> LocalOptimum | None:
        """Return the flight of so many `slots` near the last one; None where there is none."""
        problem, told = self._problem(slots, energy)
        kin, fenced = problem.kinematics, problem.fenced(problem.kinematics)
        options = problem.plan.optimizer
        if self.observe is not None:
            self.observe(Progress(1, 2, told, 0.0))
        self.optimizations += 1
        field = self.field
        if problem.plan.radio.fading == "realization":  # its draws are the slots'
            field = rate_field(problem, design(problem.plan))
        try:
            straight = straight_flight(kin)
        except InfeasibleError:
            return None
        own = problem.constraints(kin)
        start = self._near(kin, own)
        if start is None:
            limits, kept = (*constraints_of(kin), *fenced), (*constraints_of(kin), *own)
            last = feasible(kin, straight, stretched(kin, self.last), limits)
            either = (sparing_starts(kin, {"": start}, kept) for start in (last, straight))
            start = next((flight for starts in either for flight in starts.values()), None)
        if start is None:
            return None
        return maximize(
            kin,
            field,
            start,
            constraints=own,
            tolerance=max(ROUGH, options.tolerance),
            max_iterations=options.max_iterations,
            strategy=NEAR_START if kin.min_speed > 0 else None,
            relay=problem.maximised_queue,
        )

    def _near(self, kin: Kinematics, kept: Sequence[Constraint]) -> Trajectory | None:
        """Return the flight of `kin` nearest to the path of the last one, in its time.

        That is for planes: a blend of two flights of a least speed need not have it, and another
        circle about a flight that circles is no start.
        """
        if kin.min_speed == 0:
            return None
        then, now = (np.linspace(0, 1, n) for n in (kin.slots, len(self.last.w)))
        path = np.stack([np.interp(then, now, w) for w in self.last.w.T], axis=1)
        return nearest_flight(kin, path, kin.follow(stretched(kin, self.last)), kept)

    def _worth(self, slots: int, optimum: LocalOptimum | None) -> float:
        if optimum is None:
            return 0.0
        return optimum.value if self.plan.goal.rate is not None else slots * optimum.value

    def _data(self, found: Solution) -> float:
        slots = 1 if self.plan.goal.rate is not None else len(found.w)
        return slots * found.delivered_rate

    def _energy(self, found: Solution) -> float:
        energy = found.problem.energy_of(found.trajectory)
        assert energy is not None
        return energy

    def _problem(self, slots: int, energy: float) -> tuple[Problem, str]:
        """Return the problem of so many `slots` within `energy`, and its name."""
        duration = round(slots * self.plan.flight.time_step, 9)
        problem = build_problem(self.plan.changed({"flight.duration": duration}))
        limit = "" if energy == math.inf else f" within {energy / JOULES_PER_WH:.4g} Wh"
        return replace(problem, energy=energy), f"{duration:g} s{limit}"

    def _solved(
        self, slots: int, energy: float, known: Trajectory | None = None, *, alone: bool = False
    ) -> Solution:
        problem, told = self._problem(slots, energy)
        self.optimizations += 1
        return direct(problem, observe=staged(self.observe, told), known=known, alone=alone)

    def _from_all_starts(self, energy: float, possible: Integers) -> Solution:
        """Return the longest flight of `possible` slots that is found from all starts."""
        tried = np.linspace(float(possible[0]), float(possible[-1]), _TRIES).astype(int)
        if self.straight[1] <= energy:
            tried = np.append(tried, round(self.straight[0] / self.plan.flight.time_step))
        for slots in np.unique(tried)[::-1].tolist():
            with suppress(InfeasibleError):
                return self._solved(slots, energy)
        raise InfeasibleError(self._too_little(energy))

    def _too_little(self, energy: float) -> str:
        duration, least = self.straight
        return (
            f"{self.plan.source}: goal.energy_wh: no flight was found that takes at most "
            f"{energy / JOULES_PER_WH:.4g} Wh with its relay; straight from start to end it takes "
            f"{least / JOULES_PER_WH:.4g} Wh, in {duration:g} s"
        )


def least_energies(plan: Plan, slots: Integers) -> Real:
    """Return energies, J, that no flights of so many `slots` are below.

    At airspeeds v_n they pass at least D = ||w_end - w_start - wind T|| of air, and turns and gains
    only add, so that with any price lambda >= 0 of speed sum_n P(v_n, a_n) delta_t is at least
    n delta_t min_v (P(v) - lambda v) + lambda D.
    """
    model, dt = plan.power_model, plan.flight.time_step
    assert model is not None  # goals that count the energy have one
    fastest = plan.max_ground_speed + math.hypot(*plan.wind)
    v = np.linspace(plan.vehicle.min_speed, fastest, _SPEEDS)
    level = np.pad(v[:, None], ((0, 0), (0, 2)))
    P = model(level, 0 * level)
    steepest = float((np.diff(P) / np.maximum(np.diff(v), _STILL)).max())
    prices = np.linspace(0, max(0.0, steepest), _PRICES)[:, None]
    way = np.subtract(plan.flight.end, plan.flight.start)
    D = np.linalg.norm(way - dt * (slots - 1)[:, None] * np.array(plan.wind), axis=1)
    lowest = (P - prices * v).min(axis=1, keepdims=True)
    flown = (slots * dt * lowest + prices * D).max(axis=0)
    return np.asarray(flown + slots * dt * plan.radio.relay.power)


def thriftiest_straight(plan: Plan) -> tuple[float, float]:
    """Return the duration, s, of the straight flight that takes the least, and an energy for it, J.

    The energy is what a search has to be given that starts there; infinite where there is none.
    """
    taken = [(math.inf, math.inf)]
    slots = np.linspace(fewest_slots(plan), plan.flight.slots, _STRAIGHT).astype(int)
    for n in np.unique(slots).tolist():
        duration = round(n * plan.flight.time_step, 9)
        problem = build_problem(plan.changed({"flight.duration": duration}))
        limit = replace(problem, energy=0.0).energy_limit(problem.kinematics)
        assert limit is not None
        with suppress(InfeasibleError):
            energy = limit.used(straight_flight(problem.kinematics)) - limit.most  # and the relay's
            taken.append(((1 + _ABOVE) * energy, duration))
    least, duration = min(taken)
    return duration, least
