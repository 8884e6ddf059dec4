"""The plans that a study runs: the grid of values, schemes and seeds, and what a frontier adds."""

import hashlib
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from importlib.metadata import version
from typing import Any, TypeAlias

import numpy as np

from faao_mav.errors import InputError, PlanError, place_of, quote
from faao_mav.plan import Plan
from faao_mav.plan.checks import fewest_slots
from faao_mav.plan.fields import dbm
from faao_mav.plan.keys import ALIASES, POWER
from faao_mav.plan.reader import changed, plain
from faao_mav.plan.yaml_text import dump_yaml, load_yaml
from faao_mav.power import JOULES_PER_WH

Value: TypeAlias = Any
"""The value of a varied key, as YAML reads it: a number, a word, a list."""

MAX_ROWS = 100_000
"""The most rows of a study; chosen: a day of one core at a second each, and an end of typos."""


@dataclass(frozen=True, slots=True)
class StudyCase:
    """One row of a study before it has run.

    `values` are the varied keys with their values, in order. `text` is the plan with these values,
    the scheme and the seed put in; `source` names the plan in messages.
    """

    values: tuple[tuple[str, Value], ...]
    scheme: str
    seed: int
    text: str
    source: str = "plan"

    @property
    def key(self) -> str:
        """A hash of scheme, `text` and program version, which is the same on any machine."""
        content = "\0".join((version("faao-mav"), self.scheme, self.text))
        return hashlib.sha256(content.encode()).hexdigest()[:20]


def parse_vary(text: str) -> tuple[str, tuple[Value, ...]]:
    """Return the key and the values of `key=values`; see `parse_values`. Raises `InputError`.

    >>> parse_vary("flight.duration=60:120:30")
    ('flight.duration', (60, 90, 120))
    """
    key, sign, values = text.partition("=")
    if not sign:
        raise InputError(f"--vary {quote(text)}: give key=start:stop:step or key=value,value")
    return key.strip(), parse_values(values, f"--vary {place_of([key.strip()])}")


def parse_values(text: str, option: str) -> tuple[Value, ...]:
    """Return the values of `start:stop:step`, the end included, or of `value,value,...` in YAML.

    `option` names the place in messages. Raises `InputError`.
    """
    try:
        data = load_yaml(f"values: [{text}\n]", option)
    except PlanError:
        data = {}
    if list(data) != ["values"] or not isinstance(data["values"], list) or not data["values"]:
        raise InputError(f"{option}: {quote(text)} is neither start:stop:step nor value,value,...")
    found: list[Value] = []
    for value in data["values"]:
        is_range = isinstance(value, str) and ":" in value
        found += _range(value, option) if is_range else [value]
        _check_count(len(found), option)
    return tuple(found)


def _range(text: str, option: str) -> list[float]:
    """Return the numbers of `start:stop:step` in decimal arithmetic: 0:1:0.1 has 11."""
    try:
        start, stop, step = (Decimal(part.strip()) for part in text.split(":"))
        steps = (stop - start) / step
        numbers = start, stop, step, 1 / step
        fine = steps >= 0 and all(math.isfinite(float(each)) for each in numbers)
    except (ArithmeticError, ValueError):
        fine = False
    if not fine:
        raise InputError(
            f"{option}: {quote(text)} is no range; give start:stop:step, as -40:0:5, with steps "
            "that come from start to stop"
        )
    _check_count(steps, option)
    values = [start + k * step for k in range(math.floor(steps) + 1)]
    whole = all(part == part.to_integral_value() for part in (start, step))
    return [int(value) if whole else float(value) for value in values]


def _check_count(count: Decimal | int, what: str) -> None:
    if count > MAX_ROWS:
        raise InputError(f"{what}: {float(count):,.6g} rows; a study has at most {MAX_ROWS:,}")


def check_varied(keys: Iterable[str]) -> None:
    """Raise `InputError` where two `keys` of a study set the same, or one what the study is."""
    varied = {"study": "the study"}
    for key in keys:
        for path in ALIASES.get(key, (key,)):
            for other, by in varied.items():
                if f"{path}.".startswith(f"{other}.") or f"{other}.".startswith(f"{path}."):
                    told = f"{place_of([by])} sets the same; leave one out"
                    raise InputError(f"vary {place_of([key])}: {told}")
            varied[path] = key


def make_cases(
    text: str,
    *,
    vary: Mapping[str, Sequence[Value]],
    schemes: Sequence[str] = ("faao",),
    seeds: int = 1,
    source: str = "plan",
) -> tuple[StudyCase, ...]:
    """Return the grid of all values, schemes and seeds, in this order, the seeds fastest.

    `text` is a sound plan, `source` names it. Seeds count up from its `radio.seed`. Raises
    `InputError` for a grid of more than `MAX_ROWS`, a value that is varied twice, and a study that
    varies itself.

    >>> from faao_mav import read_plan
    >>> plan = read_plan("missions/copter_relay.yaml")
    >>> cases = make_cases(plan.text, vary={"flight.duration": [90, 120]}, schemes=("faao", "mrt"))
    >>> [(case.values, case.scheme) for case in cases][1]
    ((('flight.duration', 90),), 'mrt')
    """
    data = load_yaml(text, source)
    data.pop("study", None)
    vary = {key: [plain(value, source) for value in values] for key, values in vary.items()}
    _check_count(math.prod(map(len, vary.values())) * len(schemes) * seeds, source)
    check_varied(vary)
    made = []
    for values in itertools.product(*vary.values()):
        pairs = tuple(zip(vary, values, strict=True))
        changes = {path: value for key, value in pairs for path in ALIASES.get(key, (key,))}
        first = changes.get("radio.seed", data["radio"].get("seed", 0))
        for scheme, number in itertools.product(schemes, range(seeds)):
            seed = first + number if isinstance(first, int) else 0
            precoder = "faao" if scheme in ("algorithm1", "gaussian") else scheme
            chosen = {
                "optimizer.method": "algorithm1" if scheme == "algorithm1" else "direct",
                "optimizer.precoder": precoder,
                "optimizer.inputs": "gaussian" if scheme == "gaussian" else "alphabet",
            }
            seeded = {"radio.seed": seed} if isinstance(first, int) else {}
            # what is varied goes before what the scheme would have
            plan = dump_yaml(changed(data, chosen | changes | seeded))
            made.append(StudyCase(pairs, scheme, seed, plan, source))
    return tuple(made)


_DECIBELS = 20.0
"""How far below the plan's powers a frontier begins, dB. Chosen: from there on little arrives."""

ENERGY = "goal.energy_wh"

_DECIMALS = 4
"""Decimals of the energies of a frontier, Wh, which are rounded up. Chosen."""


def frontier_cases(plan: Plan, frontier: str, points: int, **grid: Any) -> tuple[StudyCase, ...]:
    """Return the cases of `grid`, see `make_cases`, at the `points` of a `frontier` of a plan.

    `duration,data`, `power,data` or `energy,data`: the most data for each, the plan's own the last.
    Durations are whole time steps from the shortest on. Powers rise by the same dB at both
    stations; where they differ the value is that of the base station, dBm. Energies, of flights of
    any duration up to the plan's, rise from the straight flight's to that of the plan without a
    limit, which is optimised for it. Raises `InputError` for another frontier, and where the plan
    cannot be asked for energies.
    """
    match frontier.replace(" ", "").split(","):
        case ["duration", "data"]:
            key, slots = "flight.duration", (fewest_slots(plan), plan.flight.slots)
            times = np.unique(np.rint(np.linspace(*slots, points))) * plan.flight.time_step
            along = [{key: time} for time in times.round(9).tolist()]
        case ["power", "data"]:
            given = dict(zip(ALIASES[POWER], map(dbm, plan.powers), strict=True))
            key = POWER if len(set(plan.powers)) == 1 else next(iter(given))
            down = np.linspace(-_DECIBELS, 0, points).round(3).tolist()
            along = [{path: round(own + less, 6) for path, own in given.items()} for less in down]
        case ["energy", "data"]:
            key = ENERGY
            along = [{key: value, "goal.maximise": "data"} for value in _energies(plan, points)]
        case _:
            accepted = "duration,data or power,data or energy,data"
            raise InputError(f"--frontier {quote(frontier)}: expected {accepted}")
    check_varied((*along[0], *grid["vary"]))
    data = load_yaml(plan.text, plan.source) | {"goal": {}}
    return tuple(
        replace(case, values=((key, next(iter(changes.values()))), *case.values))
        for changes in along
        for case in make_cases(dump_yaml(changed(data, changes)), source=plan.source, **grid)
    )


def _energies(plan: Plan, points: int) -> list[float]:
    from faao_mav.optimizer.direct import direct
    from faao_mav.optimizer.goal import thriftiest_straight
    from faao_mav.optimizer.problem import build_problem

    plan.changed({"goal": {"maximise": "data", "energy_wh": 1.0}})  # tells what is missing
    most = direct(build_problem(plan)).energy_wh
    least = thriftiest_straight(plan)[1] / JOULES_PER_WH
    assert most is not None
    values = np.linspace(min(least, most), most, points).round(_DECIMALS) + 10.0**-_DECIMALS
    return [float(value) for value in values.round(_DECIMALS)]
