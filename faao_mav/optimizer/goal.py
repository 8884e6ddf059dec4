"""Goals: the least duration, power or energy that delivers so much, the most data of an energy.

The searches rest on what is delivered growing with each. A flight at the speeds v(t / c) / c
takes c times as long along the same path: with c > 1 it keeps the limits, with ends that hover or
are free, and its rates have the same means, so that R_del never falls as T grows and T R_del rises
with it. A precoder that keeps a power limit keeps a larger one, and so does a flight with a limit
on its energy. Where the growth is not certain (known draws, which change with T; stations that
move; wind; a least speed; a buffer that fills), the answer still meets the goal and one step less
was found not to, but a smaller one may meet it.

The data that an energy E lets be delivered rise along T while there is energy to spare, and fall
where it is short, to nothing at E = T min P: a search over T finds their maximum. Energies are
those of flight and relay, J.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache
from operator import itemgetter

import numpy as np

from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.direct import direct
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.search.straight import straight_flight
from faao_mav.optimizer.shadowing import worth
from faao_mav.optimizer.solution import Least, Observer, Solution, staged
from faao_mav.plan import Plan
from faao_mav.plan.checks import fewest_slots
from faao_mav.plan.fields import MIN_DBM, dbm
from faao_mav.plan.keys import ALIASES, POWER
from faao_mav.power import JOULES_PER_WH, least_power

POWER_STEP = 0.01
"""The step of the least power, dB. Chosen: radios are set to tenths."""

ENERGY_SHARE = 1e-3
"""The step of the least energy, in shares of what the whole duration takes; finer than models of
power are true. Chosen."""

_BITS_PER_DB = math.log2(10) / 10
"""What a link gains of a dB where it is not saturated, bit/s/Hz: the most that capacity gains."""

_PRECISION, _NEAR = 0.01, 0.15
"""The share of the longest duration to which that of most data is looked for, and the share by
which durations are tried on both sides of that of a near energy. Chosen."""

_COMPARED = 50
"""Straight flights of which the thriftiest is sought, and a tenth of the airspeeds. Chosen."""

_ABOVE = 1e-4
"""The share by which an energy is above what a flight takes that is a start. Chosen: ten times what
the search leaves unused."""


def reach_goal(plan: Plan, *, observe: Observer | None = None) -> Solution:
    """Return the solution of `plan` with the least or the best quantity that its `goal` asks for.

    `Solution.least` tells how it was found. Raises `InfeasibleError` where the goal is out of
    reach, with what the limits let be delivered.

    >>> from faao_mav.plan import parse_plan
    >>> plan = parse_plan('''
    ... site: {origin: {latitude: -35.36, longitude: 149.17}}
    ... vehicle: {max_speed: 20, max_acceleration: 5}
    ... flight: {start: [0, 50], end: [50, 0], altitude: 40, duration: 20, time_step: 0.5}
    ... goal: {rate: 0.6, minimise: duration}
    ... radio:
    ...   fading: none
    ...   base_station: {position: [0, 0], power_dbm: 0}
    ...   relay: {power_dbm: 0}
    ...   ground_user: {position: [60, 60]}
    ... ''')
    >>> found = reach_goal(plan)
    >>> found.plan.flight.duration, found.delivered_rate >= 0.6
    (10.0, True)
    >>> found.least.below.plan.flight.duration, found.least.below.delivered_rate < 0.6
    (9.5, True)
    """
    flights = _Flights(plan, observe)
    if plan.goal.energy_wh is not None:
        best = flights.ended(flights.within(JOULES_PER_WH * plan.goal.energy_wh))
        return replace(best, least=Least(plan.flight.duration, None, flights.count))
    most = flights.surplus(flights.whole)
    if most < 0:
        raise InfeasibleError(_out_of_reach(plan, flights.whole))
    # whole numbers from one at which nothing is delivered to that of the plan as it is
    at: Callable[[int], Solution]
    less = most - flights.data(flights.whole)
    if plan.goal.minimise == "duration":
        limit, at = plan.flight.duration, flights.lasting
        low, high = fewest_slots(plan) - 1, plan.flight.slots
    elif plan.goal.minimise == "power":
        limit, at = dbm(plan.powers[0]), flights.stronger
        low, high = -math.ceil((dbm(min(plan.powers)) - MIN_DBM) / POWER_STEP), 0
        less = low * POWER_STEP * _BITS_PER_DB
    else:
        limit, step = flights.taken / JOULES_PER_WH, ENERGY_SHARE * flights.taken
        low, high, at = 0, round(1 / ENERGY_SHARE), lambda number: flights.within(number * step)
    solved = {high: flights.whole}

    def surplus(number: int) -> float:
        with suppress(InfeasibleError):
            solved[number] = at(number)
        return flights.surplus(solved[number]) if number in solved else -math.inf

    number = least_number(surplus, low, high, less, most)
    best, below = flights.ended(solved[number]), solved.get(number - 1)
    return replace(best, least=Least(limit, below, flights.count))


def least_number(
    surplus: Callable[[int], float], low: int, high: int, less: float, more: float
) -> int:
    """Return the least number above `low` whose `surplus`, which grows, is not negative.

    `less` < 0 and `more` >= 0 are those of `low` and `high`; -inf stands for a number without a
    flight. Numbers are roots of chords; where the same end moves again the value of the other is
    halved (the Illinois rule).

    >>> least_number(lambda n: n**2 - 200.0, 0, 1000, -200.0, 999800.0)
    15
    """
    moved = 0
    while high - low > 1:
        guess = (low + high) // 2
        if math.isfinite(less):
            guess = math.ceil(low - less / (more - less) * (high - low))
        number = min(max(guess, low + 1), high - 1)
        value = surplus(number)
        if value >= 0:
            high, more, less, moved = number, value, less / (2 if moved == 1 else 1), 1
        else:
            low, less, more, moved = number, value, more / (2 if moved == -1 else 1), -1
    return high


class _Flights:
    """Optimised flights of `plan` and of plans like it.

    `whole` is that of the plan without a limit on the energy, `taken` what it takes, J, or infinite
    without a model; `last` the last one, `count` how many were optimised.
    """

    def __init__(self, plan: Plan, observe: Observer | None) -> None:
        self.plan, self.observe, self.count = plan, observe, 0
        self.thriftiest = cache(lambda: thriftiest_straight(plan))
        self.last: Solution | None = None
        self.whole = self.last = self.changed({})
        taken = self.whole.problem.energy_of(self.whole.trajectory)
        self.taken = math.inf if taken is None else taken

    def data(self, found: Solution, less: float = 0.0) -> float:
        """Return what `found` delivers above a rate, bit/Hz per slot; where one is asked for it."""
        slots = len(found.w) if self.plan.goal.rate is None else 1
        return (worth(found) - less) * slots

    def surplus(self, found: Solution) -> float:
        """Return by how much that is above what is asked for."""
        return self.data(found, found.plan.needed_rate)

    def changed(
        self, changes: dict[str, float], energy: float = math.inf, *, alone: bool = False
    ) -> Solution:
        """Return the flight with `changes` by key, within `energy`, with `last` among its starts.

        With `alone` there is no other start.
        """
        told = [f"{key} {value:g}" for key, value in changes.items()] or ["as given"]
        if energy < math.inf:
            told.append(f"at most {energy / JOULES_PER_WH:.4g} Wh")
        self.count += 1
        self.last = direct(
            replace(build_problem(self.plan.changed(changes)), energy=energy),
            observe=staged(self.observe, ", ".join(told)),
            known=None if self.last is None else self.last.trajectory,
            alone=alone,
        )
        return self.last

    def lasting(self, slots: int, energy: float = math.inf, *, alone: bool = False) -> Solution:
        """Return the flight of so many `slots`: see `changed`."""
        duration = round(slots * self.plan.flight.time_step, 9)
        return self.changed({"flight.duration": duration}, energy, alone=alone)

    def stronger(self, steps: int) -> Solution:
        """Return the flight with so many steps of `POWER_STEP` more power, fewer below 0."""
        powers = zip(ALIASES[POWER], map(dbm, self.plan.powers), strict=True)
        return self.changed({key: round(own + steps * POWER_STEP, 6) for key, own in powers})

    def within(self, energy: float) -> Solution:
        """Return the flight of most data within `energy`, or where a rate is asked for of that.

        Raises `InfeasibleError` where none was found.
        """
        from scipy.optimize import minimize_scalar

        if energy >= self.taken:
            return self.whole
        assert self.last is not None
        step, tried = self.plan.flight.time_step, dict[int, tuple[float, Solution]]()
        duration, straight = self.thriftiest()
        low, high = fewest_slots(self.plan), self.plan.flight.slots
        fastest = self.plan.max_ground_speed + math.hypot(*self.plan.wind)
        airspeeds = np.linspace(self.plan.vehicle.min_speed, fastest, 10 * _COMPARED)
        assert self.plan.power_model is not None  # goals of an energy have one
        least = least_power(self.plan.power_model, airspeeds)[1] + self.plan.radio.relay.power
        high = min(high, int(energy / (least * step)))
        if (near := self.last.problem.energy) < math.inf:
            centre = len(self.last.w) * energy / near
            low = max(low, int((1 - _NEAR) * centre))
            high = min(high, math.ceil((1 + _NEAR) * centre))

        def missed(slots: float) -> float:
            n = round(slots)
            if n not in tried:
                with suppress(InfeasibleError):
                    found = self.lasting(n, energy, alone=True)
                    tried[n] = self.data(found), found
                    _, self.last = max(tried.values(), key=itemgetter(0))
            # without a flight the less the nearer to the duration that takes the least
            return -tried[n][0] if n in tried else abs(slots * step - duration)

        if high >= low:
            within = max(0.5, _PRECISION * high)
            minimize_scalar(missed, bounds=(low, high), method="bounded", options={"xatol": within})
        if not tried and straight <= energy:
            missed(duration / step)
        if not tried:
            raise InfeasibleError(
                f"{self.plan.source}: goal.energy_wh: no flight was found that takes at most "
                f"{energy / JOULES_PER_WH:.4g} Wh with its relay; straight from start to end it "
                f"takes {straight / JOULES_PER_WH:.4g} Wh, in {duration:g} s"
            )
        return self.last

    def ended(self, found: Solution) -> Solution:
        """Return the flight of the duration and energy of `found` from all starts."""
        energy = found.problem.energy
        if energy == math.inf:
            return found
        return max(self.lasting(len(found.w), energy), found, key=self.data)


def thriftiest_straight(plan: Plan) -> tuple[float, float]:
    """Return the duration, s, of the straight flight that takes the least, and an energy for it, J.

    The energy is what a search has to be given that starts there; infinite where there is none.
    """
    taken = [(math.inf, math.inf)]
    problem = replace(build_problem(plan), energy=0.0)
    slots = np.linspace(fewest_slots(plan), plan.flight.slots, _COMPARED).astype(int)
    for n in np.unique(slots).tolist():
        kin = replace(problem.kinematics, slots=n)
        (limit,) = problem.energy_limits(kin)
        with suppress(InfeasibleError):
            energy = limit.used(straight_flight(kin)) - limit.most  # and the relay's
            taken.append(((1 + _ABOVE) * energy, round(n * kin.time_step, 9)))
    least, duration = min(taken)
    return duration, least


def _out_of_reach(plan: Plan, best: Solution) -> str:
    goal, R_del = plan.goal, worth(best)
    if goal.deliver_mbytes is not None:
        asked = f"goal.deliver_mbytes: {goal.deliver_mbytes:g} megabytes cannot be delivered"
        most = f"{plan.megabytes(R_del):.4g} megabytes"
    else:
        asked = f"goal.rate: {goal.rate:g} bit/s/Hz cannot be delivered"
        most = f"{R_del:.4f} bit/s/Hz"
    powers = " and ".join(f"{dbm(power):g}" for power in plan.powers)
    return (
        f"{plan.source}: {asked} in {plan.flight.duration:g} s (flight.duration) at {powers} dBm "
        f"(power_dbm of base_station and relay): at most {most}; "
        "ask for less, or give more time or power"
    )
