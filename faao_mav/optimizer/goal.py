"""The least duration, power or energy that delivers what a plan's `goal` asks for.

The searches rest on what is delivered growing with each. A flight at the speeds v(t / c) / c
takes c times as long along the same path: with c > 1 it keeps the limits, with ends that hover or
are free, and its rates have the same means, so that R_del never falls as T grows and T R_del rises
with it. A precoder that keeps a power limit keeps a larger one, and so does a flight
with a limit on its energy. Each step is a whole optimisation, which has the last flight among its
starts; for an energy it is a search for the best duration: see `most_data`. Where the growth is not
certain (known draws, which change with T; wind; a least speed; a buffer that fills), the answer
still meets the goal and one step less was found not to, but a smaller one may meet it.
"""

import math
from abc import ABC, abstractmethod
from bisect import bisect_left
from collections.abc import Callable, Mapping
from dataclasses import replace

from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.direct import direct
from faao_mav.optimizer.most_data import WithinEnergy
from faao_mav.optimizer.problem import build_problem
from faao_mav.optimizer.solution import Least, Observer, Solution, staged
from faao_mav.plan import Plan
from faao_mav.plan.checks import fewest_slots
from faao_mav.plan.fields import MIN_DBM, dbm
from faao_mav.plan.keys import ALIASES, POWER
from faao_mav.power import JOULES_PER_WH

POWER_STEP = 0.01
"""The step of the least power, dB. Chosen: radios are set to tenths."""

ENERGY_SHARE = 1e-3
"""The step of the least energy, in shares of what the whole duration takes.

Chosen: models of power are less true than that."""


def least(plan: Plan, *, observe: Observer | None = None) -> Solution:
    """Return the solution of `plan` with the least duration, powers or energy that meet its `goal`.

    The solution has them; `Solution.least` tells how they were found. Raises
    `InfeasibleError` where the goal is out of reach, with what the limits let be delivered.

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
    >>> found = least(plan)
    >>> found.plan.flight.duration, found.delivered_rate >= 0.6
    (10.0, True)
    >>> found.least.below.plan.flight.duration, found.least.below.delivered_rate < 0.6
    (9.5, True)
    """
    kinds: dict[str, Callable[[Plan, Observer | None], _Search]]
    kinds = {"duration": _Durations, "power": _Powers, "energy": _Energies}
    search: _Search = kinds[plan.goal.minimise or ""](plan, observe)
    if not search.meets(search.high):
        raise InfeasibleError(_out_of_reach(plan, search.solved[search.high]))
    while search.high - search.low > 1:
        search.meets(min(max(search.guess(), search.low + 1), search.high - 1))
    best, below = search.answer(), search.solved.get(search.low)
    return replace(best, least=Least(search.limit, below, search.optimizations))


class _Search(ABC):
    """Plans by a whole number, `most` for the one given: at `high` the goal is met, at `low` not.

    `limit` is the quantity that is minimised, as the plan has it.
    """

    limit: float

    def __init__(self, plan: Plan, observe: Observer | None, low: int, high: int) -> None:
        self.plan, self.observe, self.low, self.high = plan, observe, low, high
        self.solved: dict[int, Solution | None] = {}
        self.optimizations = 0
        self.last, self.repeats = high, 0  # the last number, and how often that end has moved alone

    @abstractmethod
    def optimised(self, number: int, known: Solution | None) -> Solution:
        """Return the best flight of `number`; `known` is that of a near one."""

    @abstractmethod
    def guess(self) -> int:
        """Return about the least number that meets the goal."""

    def meets(self, number: int) -> bool:
        """Optimise at `number`, and tell whether the goal is met; without a flight it is not."""
        found: Solution | None = None
        try:
            found = self.optimised(number, self.solved.get(self.last))
        except InfeasibleError:
            if not self.solved:  # the plan as it was given
                raise
        met = found is not None and found.delivered_rate >= found.plan.needed_rate
        same = self.solved and self.last == (self.high if met else self.low)
        self.repeats = self.repeats + 1 if same else 0
        self.solved[number], self.last = found, number
        if met:
            self.high = number
        else:
            self.low = number
        return met

    def answer(self) -> Solution:
        """Return the solution at `high`, optimised from all starts."""
        found = self.solved[self.high]
        assert found is not None
        return found

    def changed(self, changes: Mapping[str, float], known: Solution | None) -> Solution:
        """Optimise the plan with `changes` by dotted keys."""
        told = ", ".join(f"{key} {value:g}" for key, value in changes.items())
        self.optimizations += 1
        return direct(
            build_problem(self.plan.changed(changes)),
            observe=staged(self.observe, told),
            known=None if known is None else known.trajectory,
        )


class _Chords(_Search):
    """Numbers in which T (R_del - needed) is nearly linear: of slots, or of shares of an energy."""

    def guess(self) -> int:
        """Return the root of the chord of T (R_del - needed).

        Long flights stay where the rate is best. Where the same end moves again and again, half of
        the other's value is taken (the Illinois rule). R_del is at most that of the longer flight:
        the first guess for megabytes is the time in which that rate delivers them.
        """
        low, high = self.solved.get(self.low), self.solved[self.high]
        assert high is not None
        if low is None:
            return self._without_flight(high)
        less, more = _surplus(low), _surplus(high)
        if self.last == self.low:
            more *= 0.5**self.repeats
        else:
            less *= 0.5**self.repeats
        return math.ceil(self.low - less / (more - less) * (self.high - self.low))

    def _without_flight(self, high: Solution) -> int:
        """Return the guess where nothing is known of less, or there is no flight."""
        first = self.low not in self.solved
        if first and self.plan.goal.deliver_mbytes is not None:
            return int(self.high * high.plan.needed_rate / high.delivered_rate)
        if first and self.plan.fence is None:
            return self.low + 1
        halfway = (self.low + self.high) // 2
        longer = min((n for n, each in self.solved.items() if each and n > self.high), default=0)
        beyond = self.solved.get(longer)
        if beyond is None:
            return halfway
        here, there = _surplus(high), _surplus(beyond)
        root = self.high - here / max(there - here, 1e-9) * (longer - self.high)
        return max(math.ceil(root), (self.low + halfway) // 2)


def _surplus(found: Solution) -> float:
    return found.plan.flight.slots * (found.delivered_rate - found.plan.needed_rate)


class _Durations(_Chords):
    """Numbers of slots."""

    def __init__(self, plan: Plan, observe: Observer | None) -> None:
        super().__init__(plan, observe, fewest_slots(plan) - 1, plan.flight.slots)
        self.limit = plan.flight.duration

    def optimised(self, number: int, known: Solution | None) -> Solution:
        duration = round(number * self.plan.flight.time_step, 9)
        return self.changed({"flight.duration": duration}, known)


class _Energies(_Chords):
    """Numbers of `ENERGY_SHARE` of what the flight of the plan's whole duration takes."""

    def __init__(self, plan: Plan, observe: Observer | None) -> None:
        most = round(1 / ENERGY_SHARE)
        super().__init__(plan, observe, 0, most)
        self.within = WithinEnergy(plan, observe)
        self.limit = self.within.unlimited_energy / JOULES_PER_WH
        least = float(self.within.least.min())
        self.low = min(most, math.ceil(most * least / self.within.unlimited_energy)) - 1
        self.whole = most

    def optimised(self, number: int, known: Solution | None) -> Solution:  # noqa: ARG002
        if number == self.whole:
            return self.within.unlimited
        return self.within.best(self.energy(number))

    def guess(self) -> int:
        """Return the chord's root, at first no less than the straight flight takes."""
        if self.high < self.whole or self.low in self.solved:
            return super().guess()
        return max(super().guess(), math.ceil(self.within.straight[1] / self.energy(1)))

    def answer(self) -> Solution:
        found = super().answer()
        if found is not self.within.unlimited:
            found = self.within.ended(found, self.energy(self.high))
        self.optimizations = self.within.optimizations
        return found

    def energy(self, number: int) -> float:
        """Return the energy of `number`, J."""
        return number * ENERGY_SHARE * self.within.unlimited_energy


class _Powers(_Search):
    """Numbers of steps of `POWER_STEP` by which both powers are changed, none or less."""

    def __init__(self, plan: Plan, observe: Observer | None) -> None:
        self.given = {
            key: dbm(power) for key, power in zip(ALIASES[POWER], plan.powers, strict=True)
        }
        self.limit = self.given[ALIASES[POWER][0]]
        room = min(self.given.values()) - MIN_DBM
        super().__init__(plan, observe, -int(room / POWER_STEP) - 1, 0)

    def optimised(self, number: int, known: Solution | None) -> Solution:
        changes = {key: round(p + number * POWER_STEP, 6) for key, p in self.given.items()}
        return self.changed(changes, known)

    def guess(self) -> int:
        """Return the number at which the last flight, with its precoders scaled, meets the goal.

        The best rate at another power is no lower, and has the same slope (the envelope theorem):
        the steps are those of Newton's method or better.
        """
        held, needed = self.solved[self.last], self.plan.needed_rate
        assert held is not None  # power has no part in whether there is a flight

        def met(number: int) -> bool:
            scale = 10 ** ((number - self.last) * POWER_STEP / 10)
            return held.relay(*held.recomputed_slots(scale), held.shares).rate >= needed

        between = range(self.low + 1, self.high)
        return self.low + 1 + bisect_left(between, True, key=met)


def _out_of_reach(plan: Plan, best: Solution | None) -> str:
    assert best is not None
    goal, R_del = plan.goal, best.delivered_rate
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
