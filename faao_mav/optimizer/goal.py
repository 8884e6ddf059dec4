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
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

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

_BITS_PER_DB = math.log2(10) / 10
"""What a link gains of a dB where it is not saturated, bit/s/Hz: the most that capacity gains."""


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
    kinds = {"duration": _durations, "power": _powers, "energy": _energies}
    steps = kinds[plan.goal.minimise or ""](plan, observe)
    solved = {steps.high: steps.at(steps.high, None)}
    first = steps.first(solved[steps.high])

    def surplus(number: int) -> float:
        if number not in solved:
            known = next(reversed(solved.values()))
            with suppress(InfeasibleError):
                solved[number] = steps.at(number, known)
        return _surplus(solved[number]) if number in solved else -math.inf

    if surplus(steps.high) < 0:
        raise InfeasibleError(_out_of_reach(plan, solved[steps.high]))
    number = least_number(surplus, steps.low, steps.high, first)
    best, below = steps.ended(number, solved[number]), solved.get(number - 1)
    return replace(best, least=Least(steps.limit, below, steps.optimizations()))


def least_number(surplus: Callable[[int], float], low: int, high: int, guess: int) -> int:
    """Return the least number above `low` whose `surplus`, which grows, is not negative.

    It is known not to be at `high`; -inf stands for a number without a flight. `guess` is tried
    first. Then numbers are roots of chords; where the same end moves again the value of the other
    is halved (the Illinois rule).

    >>> least_number(lambda n: n**2 - 200.0, 0, 1000, 500)
    15
    """
    less, more, moved = -math.inf, surplus(high), 0
    beyond = (high, more)  # the last number above `high`
    while high - low > 1:
        number = min(max(guess, low + 1), high - 1)
        value = surplus(number)
        if value >= 0:
            beyond, high, more = (high, more), number, value
            less, moved = (less / 2 if moved == 1 else less), 1
        else:
            low, less = number, value
            more, moved = (more / 2 if moved == -1 else more), -1
        if math.isfinite(less):
            guess = math.ceil(low - less / (more - less) * (high - low))
        elif beyond[0] > high and beyond[1] > more:
            root = high - more * (beyond[0] - high) / (beyond[1] - more)
            guess = max(math.ceil(root), (3 * low + high) // 4)
        else:
            guess = (low + high) // 2
    return high


@dataclass(frozen=True)
class _Steps:
    """Plans by a whole number: at `high` the one that was given, at `low` none that meets the goal.

    `limit` is the quantity of the plan that is minimised, `at` optimises at a number, from the
    flight of a near one, `first` is the first guess, `ended` the answer from all starts.
    """

    low: int
    high: int
    limit: float
    at: Callable[[int, Solution | None], Solution]
    first: Callable[[Solution], int]
    ended: Callable[[int, Solution], Solution]
    optimizations: Callable[[], int]


def _surplus(found: Solution) -> float:
    return found.plan.flight.slots * (found.delivered_rate - found.plan.needed_rate)


def _of_plans(
    plan: Plan,
    observe: Observer | None,
    low: int,
    high: int,
    limit: float,
    changes: Callable[[int], dict[str, Any]],
    first: Callable[[Solution], int],
) -> _Steps:
    """Return the steps of plans with `changes` by dotted keys."""
    count = 0

    def at(number: int, known: Solution | None) -> Solution:
        nonlocal count
        count += 1
        told = ", ".join(f"{key} {value:g}" for key, value in changes(number).items())
        return direct(
            build_problem(plan.changed(changes(number))),
            observe=staged(observe, told),
            known=None if known is None else known.trajectory,
        )

    return _Steps(low, high, limit, at, first, lambda _, found: found, lambda: count)


def _durations(plan: Plan, observe: Observer | None) -> _Steps:
    """Return numbers of slots.

    R_del is at most that of the longer flight: the first guess for megabytes is the time in which
    that rate delivers them, for a rate the shortest flight.
    """
    low, high = fewest_slots(plan) - 1, plan.flight.slots

    def changes(number: int) -> dict[str, float]:
        return {"flight.duration": round(number * plan.flight.time_step, 9)}

    def first(whole: Solution) -> int:
        if plan.goal.deliver_mbytes is None:
            return low + 1
        return int(high * whole.plan.needed_rate / whole.delivered_rate)

    return _of_plans(plan, observe, low, high, plan.flight.duration, changes, first)


def _powers(plan: Plan, observe: Observer | None) -> _Steps:
    """Return numbers of steps of `POWER_STEP` by which both powers are changed, none or less."""
    given = {key: dbm(power) for key, power in zip(ALIASES[POWER], plan.powers, strict=True)}
    low = -int((min(given.values()) - MIN_DBM) / POWER_STEP) - 1

    def changes(number: int) -> dict[str, float]:
        return {key: round(power + number * POWER_STEP, 6) for key, power in given.items()}

    def first(whole: Solution) -> int:
        spare = whole.delivered_rate - whole.plan.needed_rate
        return -int(spare / _BITS_PER_DB / POWER_STEP)

    limit = given[ALIASES[POWER][0]]
    return _of_plans(plan, observe, low, 0, limit, changes, first)


def _energies(plan: Plan, observe: Observer | None) -> _Steps:
    """Return numbers of `ENERGY_SHARE` of what the flight of the plan's whole duration takes."""
    within, high = WithinEnergy(plan, observe), round(1 / ENERGY_SHARE)
    step = ENERGY_SHARE * within.unlimited_energy

    def at(number: int, _: Solution | None) -> Solution:
        return within.unlimited if number == high else within.best(number * step)

    def first(whole: Solution) -> int:
        """Return the share of the time that is needed, at least what the straight flight takes."""
        share = whole.plan.needed_rate / whole.delivered_rate
        straight = math.ceil(within.straight[1] / step)
        return max(int(high * share) if plan.goal.deliver_mbytes is not None else 0, straight)

    def ended(number: int, found: Solution) -> Solution:
        return found if number == high else within.ended(found, number * step)

    limit = within.unlimited_energy / JOULES_PER_WH
    return _Steps(0, high, limit, at, first, ended, lambda: within.optimizations)


def _out_of_reach(plan: Plan, best: Solution) -> str:
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
