"""The most data that an energy lets be delivered, in any duration up to the plan's.

The data D(T, E) of the best flight of duration T within the energy E rises with E. Along T it rises
while there is energy to spare and falls where it is short, to nothing at E = T min P. One search
over T finds its maximum: each step improves the last step's flight. The flight of the best
T is then optimised from all starts. Energies are those of flight and relay, J.
"""

import math
from contextlib import suppress
from dataclasses import replace
from functools import cached_property

import numpy as np

from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.direct import direct
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.problem import Problem, build_problem
from faao_mav.optimizer.search.multistart import stretched
from faao_mav.optimizer.search.starts import straight_flight
from faao_mav.optimizer.search.track import nearest_flight
from faao_mav.optimizer.solution import Least, Observer, Solution, staged
from faao_mav.plan import Plan
from faao_mav.plan.checks import fewest_slots
from faao_mav.power import JOULES_PER_WH

_PRECISION = 0.01
"""The share of the longest duration to which the best one is looked for. Chosen."""

_NEAR = 0.15
"""The share by which durations are tried on both sides of that of a near energy. Chosen."""

_STRAIGHT = 50
"""Durations of straight flights that are compared. Chosen."""

_SPEEDS = 500
"""Airspeeds among which that of the least power is looked for. Chosen."""

_ABOVE = 1e-4
"""The share by which an energy is above what a flight takes that is a start. Chosen: ten times what
the search leaves unused."""


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
        self.unlimited = self._solved(plan.flight.slots, math.inf)
        taken = self.unlimited.problem.energy_of(self.unlimited.trajectory)
        assert taken is not None
        assert plan.power_model is not None  # goals of an energy have one
        self.unlimited_energy = taken
        self.last, self.last_energy = self.unlimited, math.inf
        fastest = plan.max_ground_speed + math.hypot(*plan.wind)
        airspeeds = np.linspace(plan.vehicle.min_speed, fastest, _SPEEDS)
        self.least_power = plan.power_model.least_power(airspeeds)[1] + plan.radio.relay.power

    @cached_property
    def straight(self) -> tuple[float, float]:
        """The duration, s, and energy, J, of the straight flight that takes the least."""
        return thriftiest_straight(self.plan)

    def best(self, energy: float) -> Solution:
        """Return the flight of most data, or where a rate is asked for of the highest rate.

        Raises `InfeasibleError` where none was found.
        """
        from scipy.optimize import minimize_scalar

        step = self.plan.flight.time_step
        low, high = fewest_slots(self.plan), self.plan.flight.slots
        high = min(high, int(energy / (self.least_power * step)))
        if math.isfinite(self.last_energy):
            centre = len(self.last.w) * energy / self.last_energy
            low = max(low, int((1 - _NEAR) * centre))
            high = min(high, math.ceil((1 + _NEAR) * centre))
        found: dict[int, Solution] = {}

        def missed(slots: float) -> float:
            n = round(slots)
            if n not in found:
                with suppress(InfeasibleError):
                    found[n] = self._solved(n, energy, self.last)
                    self.last = max(found.values(), key=self._worth)
            return -self._worth(found[n]) if n in found else 0.0

        if high > low:
            within = max(0.5, _PRECISION * high)
            minimize_scalar(missed, bounds=(low, high), method="bounded", options={"xatol": within})
        elif high == low:
            missed(low)
        if not found:
            duration, least = self.straight
            if least > energy:
                raise InfeasibleError(self._too_little(energy))
            missed(duration / step)
        if not found:
            raise InfeasibleError(self._too_little(energy))
        self.last_energy = energy
        return self.last

    def ended(self, best: Solution, energy: float) -> Solution:
        """Return the flight of the duration of `best` from all starts."""
        whole = self._solved(len(best.w), energy, best, alone=False)
        return max(whole, best, key=self._worth)

    def _worth(self, found: Solution) -> float:
        slots = 1 if self.plan.goal.rate is not None else len(found.w)
        return slots * found.delivered_rate

    def _solved(
        self, slots: int, energy: float, known: Solution | None = None, *, alone: bool = True
    ) -> Solution:
        """Return the flight of so many `slots` within `energy`, from the flight `known` `alone`."""
        duration = round(slots * self.plan.flight.time_step, 9)
        problem = build_problem(self.plan.changed({"flight.duration": duration}))
        limit = "" if energy == math.inf else f" within {energy / JOULES_PER_WH:.4g} Wh"
        problem = replace(problem, energy=energy)
        self.optimizations += 1
        return direct(
            problem,
            observe=staged(self.observe, f"{duration:g} s{limit}"),
            known=None if known is None else _in_time(problem, known.trajectory),
            alone=known is not None and alone,
        )

    def _too_little(self, energy: float) -> str:
        duration, least = self.straight
        return (
            f"{self.plan.source}: goal.energy_wh: no flight was found that takes at most "
            f"{energy / JOULES_PER_WH:.4g} Wh with its relay; straight from start to end it takes "
            f"{least / JOULES_PER_WH:.4g} Wh, in {duration:g} s"
        )


def _in_time(problem: Problem, flight: Trajectory) -> Trajectory:
    """Return the flight of `problem` nearest to the path of `flight`, for planes; `flight` if none.

    A blend of two flights of a least speed need not have it.
    """
    kin = problem.kinematics
    if kin.min_speed == 0:
        return flight
    then, now = (np.linspace(0, 1, n) for n in (kin.slots, len(flight.w)))
    path = np.stack([np.interp(then, now, w) for w in flight.w.T], axis=1)
    slower = kin.follow(stretched(kin, flight))
    return nearest_flight(kin, path, slower, problem.constraints(kin)) or flight


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
