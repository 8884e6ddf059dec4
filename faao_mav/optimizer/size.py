"""What a plan costs, reckoned from its sizes, so that one too large is refused before the work.

Nearly all time goes into sums over the difference classes of the two alphabets, of which there are
about as many as difference vectors over the rotations of the alphabet. A sum costs one exponential
a class, or fewer where one stream is summed by its parts (``radio.lattice_sum``); one with second
derivatives by the precoder, for Newton's method, as many products as there are pairs of the N_t²
real coordinates of P^H H^H H P, and algebra on matrices of 2 N_t² rows. How often each is formed
follows from the slots and the draws of the fading.
"""

import contextlib
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from faao_mav.errors import PlanError
from faao_mav.plan import Plan
from faao_mav.plan.radio import Radio
from faao_mav.radio.best_precoder import has_closed_form
from faao_mav.radio.constellation import (
    MODULATIONS,
    constellation,
    difference_vector_count,
    lattice,
)
from faao_mav.radio.mutual_information import MAX_INPUTS

_Value = TypeVar("_Value", int, float, str)

MAX_SECONDS, MAX_GIGABYTES = 600.0, 8.0
"""Time of one processor and memory beyond which a plan is refused. Chosen."""

# Fitted to the plans of benchmarks/sizes.py, whose times they give within a factor of two,
# and to 200 random ones of benchmarks/any_plan.py.
# Not those of algorithm1, which has a limit of its own.
_EXPONENTIAL = 1.3e-9  # s for one exponential
_PRODUCT = 3e-11  # s for one product of an exponential with a pair of coordinates
_DENSE = 6e-10  # s for one product of the dense algebra after the sums over the classes
_ALWAYS = 1.0  # s of any plan
_LEAST_SPEED = 2.0  # s more of one with a least speed
_LEAST_SPEED_SLOT = 7.5e-3  # s more of it for each slot
_PROGRAM = 0.1  # GB of any plan
_FLIGHT_SLOT = 7e-4  # s for each slot, of the flight and of the mission that flies it
_SUMS = 16  # sums for each slot and draw: of the flight found and of its prediction
_CURVE = 1700  # sums with derivatives for each draw in the table of a link's rate
_SLOT = 3  # the same for each draw of a slot of the flight found
_KNOWN = 0.3  # s more of a plan with known draws
_TABLE = 250_000  # sums with derivatives for the table of known draws, of two modes at most
_KNOWN_SLOT = 3000  # the same for each slot of the flight found, with known draws
_SEARCHED_SLOT = 25_000  # the same for each slot where the search is repeated at every place
_SAMPLED = 1.6e-4  # s for each vector of symbols, for the mutual information of a summary
_EXACT = 5e-4  # the same where the slots are not a sample of those of many draws
_CLASS_BYTES = 40  # for each difference vector and each number by which they are merged
_HELD_BYTES = 250  # for each class in each slot, where rates of known draws are differentiated
_CHANNEL_COPIES = 4  # copies of the channels of all slots and draws held at once

_NODES = 4096  # points of the noise in each mutual information that is optimised
_NODE = 60  # exponentials that one such point costs beside one for each vector of symbols
_FEWEST_DRAWS = 4  # draws below which no plan is proposed
_GOAL = 7  # optimisations that a search for a goal takes at most (benchmarks/goals.py)

_ROTATIONS = {"bpsk": 2, "8psk": 8}
"""Phases that map an alphabet onto itself, by which differences merge; 4 where not listed."""


def check_size(plan: Plan) -> None:
    """Raise `PlanError` where optimising `plan` takes longer than ten minutes or more than 8 GB.

    Alphabets on so many antennas that no mutual information is computed are refused too. The error
    names the keys with their values, and for each the largest that would do.
    """
    if not (reason := _too_large(plan)):
        return
    radio = plan.radio
    base, relay, user = _antennas(radio)
    draws = f", {radio.fading_samples:,} draws (radio.fading_samples)" if _averages(radio) else ""
    raise PlanError(
        f"{plan.source}: radio.modulation: {radio.modulation} with {base}, {relay} and {user} "
        f"antennas (radio.*.antennas) in {plan.flight.slots:,} slots{draws} {reason}; "
        f"{' or '.join(_that_would_do(plan)) or 'less of several of them'} would do"
    )


def _too_large(plan: Plan) -> str:
    """Return why `plan` is not accepted, as a part of a sentence; empty where it is."""
    radio = plan.radio
    inputs = len(constellation(radio.modulation)) ** max(_antennas(radio)[:2])
    if inputs > MAX_INPUTS:
        return f"sends one of {inputs:.4g} vectors, at most {MAX_INPUTS:,} are accepted"
    seconds, gigabytes = cost(plan)
    if seconds <= MAX_SECONDS and gigabytes <= MAX_GIGABYTES:
        return ""
    return (
        f"takes {_about(seconds / 60)} minutes and {_about(gigabytes)} GB, at most "
        f"{MAX_SECONDS / 60:.0f} minutes and {MAX_GIGABYTES:.0f} GB are accepted"
    )


def cost(plan: Plan) -> tuple[float, float]:
    """Return about how long a whole plan takes, s of one processor, and its memory, GB.

    A goal that is searched for takes several optimisations.

    >>> from faao_mav import read_plan
    >>> seconds, gigabytes = cost(read_plan("missions/copter_relay.yaml"))
    >>> 1 < seconds < 3, gigabytes < 0.5
    (True, True)
    """
    radio, slots = plan.radio, plan.flight.slots
    base, relay, user = _antennas(radio)
    (first, held), (second, also) = (
        _link_cost(plan, transmit, receive) for transmit, receive in ((base, relay), (relay, user))
    )
    channels = 16 * _CHANNEL_COPIES * _draws(radio) * slots * relay * (base + user)
    seconds = _ALWAYS + _FLIGHT_SLOT * slots + first + second
    if plan.vehicle.min_speed > 0:
        seconds += _LEAST_SPEED + _LEAST_SPEED_SLOT * slots
    if radio.fading == "realization":
        seconds += _KNOWN
    seconds *= _GOAL if plan.goal.searches else 1
    return seconds, _PROGRAM + (max(held, also) + channels) / 1e9


def _antennas(radio: Radio) -> tuple[int, int, int]:
    """Return N_t, N_u and N_r."""
    return radio.base_station.antennas, radio.relay.antennas, radio.ground_user.antennas


def _link_cost(plan: Plan, transmit: int, receive: int) -> tuple[float, float]:
    """Return the time of a link, s, and the bytes of its difference classes and their exponents."""
    radio, slots, options = plan.radio, plan.flight.slots, plan.optimizer
    vectors = float(difference_vector_count(radio.modulation, transmit))
    classes = vectors / _ROTATIONS.get(radio.modulation, 4)
    inputs = float(len(constellation(radio.modulation))) ** transmit
    draws, modes = _draws(radio), min(transmit, receive * _draws(radio))
    parts = lattice(radio.modulation, transmit)
    # Of one stream two sums over L values stand for L² differences, four alike by rotation.
    terms = classes if parts is None else 0.5 * vectors / len(parts.values)
    each = _EXPONENTIAL * terms
    seconds = _SUMS * slots * draws * each
    if transmit > 1:  # of one symbol it takes next to nothing
        seconds += (_SAMPLED if draws > 1 else _EXACT) * inputs
    if options.rate == "mutual_information":
        seconds += _EXPONENTIAL * (_SUMS * slots + _CURVE) * _NODES * (inputs + _NODE)
    exact = draws == 1 and has_closed_form(radio.modulation, transmit)
    searched = options.precoder == "faao" and options.inputs != "gaussian"
    if options.method == "direct" and searched and not exact:
        pairs = 0.5 * transmit**4
        each += _PRODUCT * terms * pairs + _DENSE * (2 * modes * transmit) ** 2 * transmit**2
        seconds += each * _newton_sums(radio, slots, few_modes=min(transmit, receive) <= 2)
    known = _HELD_BYTES * slots * classes if radio.fading == "realization" else 0.0
    return seconds, _CLASS_BYTES * vectors * transmit * (transmit + 1) + known


def _newton_sums(radio: Radio, slots: int, *, few_modes: bool) -> float:
    """Return about how many sums with second derivatives a link takes, over all channels."""
    if radio.fading != "realization":
        return _draws(radio) * (_CURVE + _SLOT * slots)
    if few_modes:
        return _TABLE + _KNOWN_SLOT * slots
    return _SEARCHED_SLOT * slots


def _averages(radio: Radio) -> bool:
    return radio.fading == "ergodic"


def _draws(radio: Radio) -> int:
    return radio.fading_samples if _averages(radio) else 1


def _that_would_do(plan: Plan) -> Iterator[str]:
    """Yield for each key the largest value with which `plan` is accepted, the others being kept."""
    radio, flight = plan.radio, plan.flight
    antennas = {
        f"radio.{name}.antennas": getattr(radio, name).antennas
        for name in ("base_station", "relay", "ground_user")
    }

    def largest(
        values: Iterable[_Value], changes: Callable[[_Value], dict[str, Any]]
    ) -> _Value | None:
        for value in values:
            with contextlib.suppress(PlanError):  # other keys may not allow it
                if not _too_large(plan.changed(changes(value))):
                    return value
        return None

    smaller = reversed(MODULATIONS[: MODULATIONS.index(radio.modulation)])
    alphabet = largest(smaller, lambda name: {"radio.modulation": name})
    if alphabet is not None:
        yield f"radio.modulation: {alphabet}"
    fewer = largest(
        range(max(antennas.values()) - 1, 0, -1),
        lambda most: {key: min(own, most) for key, own in antennas.items()},
    )
    if fewer is not None:
        yield f"at most {fewer} antennas"
    if _averages(radio):
        tenths = (radio.fading_samples * k // 10 for k in range(9, 0, -1))
        draws = largest(
            (n for n in tenths if n >= _FEWEST_DRAWS), lambda n: {"radio.fading_samples": n}
        )
        if draws is not None:
            yield f"radio.fading_samples: {draws}"
    longer = (flight.time_step * k for k in (2, 5, 10))
    step = largest(longer, lambda step: {"flight.time_step": step})
    if step is not None:
        yield f"flight.time_step: {step:g}"


def _about(number: float) -> str:
    """Return `number` to two digits, as far as it says something.

    >>> _about(0.2), _about(16.4), _about(4321.0)
    ('below 1', 'about 16', 'over 1,000')
    """
    if not 1 <= number <= 1000:
        return "below 1" if number < 1 else "over 1,000"
    return f"about {float(f'{number:.2g}'):.0f}"
