"""The most data that an energy lets be delivered, in any duration up to the plan's.

The data D(T, E) of the best flight of duration T within the energy E rises with E. Along T it rises
while there is energy to spare and falls where it is short, to nothing at E = T min P. Its maximum is
found by one search over T, whose steps improve the flight of the last step alone, roughly; a whole
optimisation from all starts ends it. Energies are those of flight and relay, J.
"""

import math
from dataclasses import replace

import numpy as np

from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.direct import direct
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.search.starts import straight_flight
from faao_mav.optimizer.solution import Least, Observer, Solution, staged
from faao_mav.plan import Plan, changed_plan
from faao_mav.plan.checks import fewest_slots
from faao_mav.power import JOULES_PER_WH

_PRECISION = 0.004
"""The share of the longest duration to which the best one is looked for. Chosen."""

_NEAR = 0.15
"""The share by which durations are tried on both sides of that of a near energy. Chosen."""

_BETTER = 1e-3
"""The share of data by which a flight from other starts has to be better to look for its duration
anew. Chosen: the precision of a rough search is some ten times that."""

_SPEEDS = 500
"""Airspeeds among which that of least power is looked for. Chosen."""

_TRIES = 8
"""Durations for which flights are tried from all starts where the one of most data leads to none."""


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
        model, power = plan.power_model, plan.radio.relay.power
        assert model is not None  # goals that count the energy have one
        fastest = plan.max_ground_speed + math.hypot(*plan.wind)
        speeds = np.linspace(plan.vehicle.min_speed, fastest, _SPEEDS)
        self.fewest = fewest_slots(plan)
        self.per_slot = plan.flight.time_step * (model.least_power(speeds)[1] + power)
        self.last = self.unlimited = self._solved(plan.flight.slots, math.inf)
        self.unlimited_energy = self._energy(self.unlimited)

    @property
    def least_energy(self) -> float:
        """An energy that no flight is below."""
        return self.fewest * self.per_slot

    def best(self, energy: float) -> Solution:
        """Return the flight of most data, roughly, or where a rate is asked for of the highest.

        Raises `InfeasibleError` where none was found.
        """
        from scipy.optimize import minimize_scalar

        most = min(self.plan.flight.slots, int(energy / self.per_slot))
        low, high = self.fewest, most
        if self.last is not self.unlimited:
            centre = self.last.plan.flight.slots * energy / self._energy(self.last)
            low, high = max(low, int((1 - _NEAR) * centre)), min(high, int((1 + _NEAR) * centre))
        found: dict[int, Solution | None] = {}

        def missed(slots: float) -> float:
            n = round(slots)
            if n not in found:
                found[n] = self._tried(n, energy, alone=True)
            return -self._worth(found[n])

        if high > low:
            step = max(0.5, _PRECISION * high)
            minimize_scalar(missed, bounds=(low, high), method="bounded", options={"xatol": step})
        elif high == low:
            missed(low)
        best = max(found.values(), key=self._worth, default=None)
        if best is None:
            best = self._from_all_starts(energy, most)
        self.last = best
        return best

    def ended(self, best: Solution, energy: float) -> Solution:
        """Return the flight of the duration of `best` from all starts, to the plan's tolerance."""
        whole = self._solved(best.plan.flight.slots, energy, best)
        if self._worth(whole) > (1 + _BETTER) * self._worth(best):
            self.last = whole
            whole = self._solved(self.best(energy).plan.flight.slots, energy, self.last)
        return max(whole, best, key=self._worth)

    def _worth(self, found: Solution | None) -> float:
        if found is None:
            return 0.0
        slots = 1 if self.plan.goal.rate is not None else found.plan.flight.slots
        return slots * found.delivered_rate

    def _energy(self, found: Solution) -> float:
        energy = build_problem(found.plan).energy_of(found.trajectory)
        assert energy is not None
        return energy

    def _solved(
        self, slots: int, energy: float, known: Solution | None = None, *, alone: bool = False
    ) -> Solution:
        duration = round(slots * self.plan.flight.time_step, 9)
        problem = build_problem(changed_plan(self.plan, {"flight.duration": duration}))
        told = f"{duration:g} s"
        if energy < math.inf:
            told = f"within {energy / JOULES_PER_WH:.4g} Wh in {told}"
        self.optimizations += 1
        return direct(
            replace(problem, energy=energy),
            observe=staged(self.observe, told),
            known=None if known is None else known.trajectory,
            alone=alone,
        )

    def _tried(self, slots: int, energy: float, *, alone: bool) -> Solution | None:
        """Return the flight of so many `slots` from that of the last, None where there is none."""
        try:
            self.last = found = self._solved(slots, energy, self.last, alone=alone)
        except InfeasibleError:
            return None
        return found

    def _from_all_starts(self, energy: float, most: int) -> Solution:
        for slots in np.unique(np.linspace(most, self.fewest, _TRIES).astype(int))[::-1].tolist():
            found = self._tried(slots, energy, alone=False) if slots <= most else None
            if found is not None:
                return found
        raise InfeasibleError(self._too_little(energy))

    def _too_little(self, energy: float) -> str:
        times = np.unique(np.linspace(self.fewest, self.plan.flight.slots, 50).astype(int))
        plans = [
            changed_plan(self.plan, {"flight.duration": round(n * self.plan.flight.time_step, 9)})
            for n in times.tolist()
        ]
        taken = {}
        for problem in map(build_problem, plans):
            try:
                taken[problem.plan.flight.duration] = problem.energy_of(
                    straight_flight(problem.kinematics)
                )
            except InfeasibleError:
                continue
        told = ""
        if taken:
            duration = min(taken, key=lambda each: taken[each] or math.inf)
            told = (
                f"; the straight flight of {duration:g} s takes "
                f"{(taken[duration] or 0.0) / JOULES_PER_WH:.4g} Wh"
            )
        return (
            f"{self.plan.source}: goal.energy_wh: no flight was found that takes at most "
            f"{energy / JOULES_PER_WH:.4g} Wh with its relay{told}"
        )
