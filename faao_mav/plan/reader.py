"""`plan.yaml` -> `Plan`, or lines that name key, value and what is accepted."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from faao_mav.autopilot import Vehicle
from faao_mav.errors import InputError, PlanError, place_of, quote
from faao_mav.files import read_columns, read_text
from faao_mav.plan.checks import problems
from faao_mav.plan.fence import geofence, written_out
from faao_mav.plan.keys import reference, unknown
from faao_mav.plan.model import PlanContents
from faao_mav.plan.sections import CHOICES
from faao_mav.plan.station import read_track
from faao_mav.plan.yaml_text import MAX_CHARACTERS, dump_yaml, load_yaml
from faao_mav.radio.gain_map import GainMap
from faao_mav.radio.map_file import MAX_WORD, WORD, map_word, read_map

_MAX_LINES = 6
"""Lines of a message; chosen to fit a small terminal."""


MAX_BESIDE = 250_000
"""Characters of the longest file that a plan names: two of them, indented, fit into its text."""

RATES = (("snr_db", "mbit_per_s"), ("snr_db", "bit_per_s_per_hz"))
"""The columns of a table of rates."""


@dataclass(frozen=True, slots=True, init=False)
class Plan(PlanContents):
    """A validated plan, in SI units: `text` is its YAML, `source` the name of its file.

    Plans are made by `read_plan`, `parse_plan` and `Plan.from_dict`, and varied by `changed`, which
    check them and keep text and values the same. `dataclasses.replace` raises `InputError`.

    >>> plan = read_plan("missions/copter_relay.yaml")
    >>> lower = plan.changed({"flight.altitude": 60, "optimizer.method": "direct"})
    >>> lower.flight.altitude, "altitude: 60" in lower.text, plan.flight.altitude
    (60.0, True, 100.0)
    """

    text: str = field(init=False)
    source: str = field(init=False)

    def __init__(self, **_: object) -> None:
        raise InputError(
            "a plan is not put together or replaced field by field: use "
            'plan.changed({"flight.altitude": 60}) or Plan.from_dict({...}), which check it'
        )

    def __repr__(self) -> str:
        """Say what is to be flown, in a line."""
        flight, given = self.flight, self.vehicle
        slots = f"{flight.duration:g} s in slots of {flight.time_step:g} s"
        return f"<Plan {self.name!r}: {slots}, {given.autopilot} {given.type}>"

    @property
    def aircraft(self) -> Vehicle:
        """The vehicle, with the parameters that the plan gives."""
        given, source = self.vehicle, f"{self.source}: vehicle.parameters"
        return Vehicle(given.autopilot, given.type, given.parameters, source, given.body)

    @property
    def candidates(self) -> tuple[Mapping[str, float], ...]:
        """The sets of parameters to try, the gentlest first.

        An autopilot whose ramps take longer than the plan's falls behind at every one; one that
        turns corners at a crawl does so in every curve. Few parameters decide that. One empty set
        if the plan keeps its vehicle's own, or if they are tuned on each vehicle, as a plane's are.
        """
        if self.mission.parameters == "keep":
            return ({},)
        limits = self.vehicle.max_speed, self.vehicle.max_acceleration
        return tuple(self.aircraft.type.recommended(*limits))

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], source: str = "plan") -> "Plan":
        """Return the plan of the keys and values `data`, nested as in `plan.yaml`, in its units.

        Tuples and NumPy's numbers and arrays count as lists and numbers. `source` names it in
        messages; files that it names lie beside it. Raises `PlanError` as `read_plan` does.
        """
        return parse_plan(dump_yaml(plain(data, source)), source)

    def changed(self, changes: Mapping[str, Any]) -> "Plan":
        """Return the plan with the values at dotted keys of its file replaced, in its units.

        None is the default of a key that has one. Raises `PlanError` as `read_plan` does.
        """
        data = changed(load_yaml(self.text, self.source), changes)
        return Plan.from_dict(data, self.source)


_READER: TypeAdapter[Plan] = TypeAdapter(Plan)


def read_plan(path: str | Path) -> Plan:
    """Read and validate the plan in the file `path`.

    Raises `PlanError` that names the file, the key, the value and what would be accepted.

    >>> plan = read_plan("missions/copter_relay.yaml")
    >>> plan.flight.start, plan.flight.duration, plan.radio.modulation
    ((0.0, 350.0), 120.0, 'qpsk')
    """
    text = read_text(path, 4 * MAX_CHARACTERS + 2 * MAX_WORD, "a plan", PlanError)
    return parse_plan(text, str(path))


def parse_plan(text: str, source: str = "plan") -> Plan:
    """Validate the plan in `text`; `source` names it in messages. See `read_plan`.

    >>> from pathlib import Path
    >>> parse_plan(Path("missions/copter_relay.yaml").read_text()).flight.duration
    120.0
    """
    data = load_yaml(text, source)
    files = filled_in(data, source)
    try:
        plan = _READER.validate_python(data, context={})
    except ValidationError as error:
        raise PlanError(_describe(error, source, files)) from None
    fence = geofence(plan, source)
    if of_file := plan.fence is not None and plan.fence.file is not None:
        data["fence"] = written_out(fence, plan.fence.margin)
    # a copy of the text, as beside a result, has to stand without the files that it names
    if files or of_file:
        text = dump_yaml(data)
    for name, value in {"geofence": fence, "text": text, "source": source}.items():
        object.__setattr__(plan, name, value)
    for problem in problems(plan):
        raise PlanError(f"{source}: {problem}")
    return plan


def read_rates(
    text: str, path: str, choices: Sequence[tuple[str, ...]] = RATES
) -> dict[str, list[float]]:
    """Return the columns of a table of rates; raise `PlanError` that names line and value."""
    try:
        return read_columns(text, choices)[1]
    except InputError as error:
        raise PlanError(f"{path}: {error}") from None


_GAINS = (("radio", "gain"), ("radio", "base_station", "gain"), ("radio", "ground_user", "gain"))

_FILES: tuple[tuple[tuple[str, ...], Callable[[str, str], Any] | None], ...] = (
    *((keys, load_yaml) for keys in _GAINS),
    *(((*keys, "map"), None) for keys in _GAINS),
    (("radio", "base_station", "track"), read_track),
    (("radio", "ground_user", "track"), read_track),
    (("radio", "rates"), read_rates),
)
"""Keys whose value may be the name of a file with what stands there otherwise, and how it is read:
from its text, and its name for messages. Maps are no text."""


def filled_in(data: dict[str, Any], source: str) -> dict[tuple[str, ...], str]:
    """Put what is in the files that the plan `data` names into their places; return them by key.

    Names are relative to the plan's file `source`, that of a map to the file that names it. Raises
    `PlanError` for a file that cannot be read.
    """
    files: dict[tuple[str, ...], str] = {}
    for keys, read in _FILES:
        section, key, law = data, keys[-1], files.get(keys[:-1])
        for step in keys[:-1]:
            inside = section.get(step)
            section = inside if isinstance(inside, dict) else {}
        name = section.get(key)
        if not isinstance(name, str) or "\n" in name or name.startswith(WORD):
            continue  # it is the content itself
        path = Path(law or source).parent / name
        try:
            if read is None:
                section[key] = _word(path, path.is_file() and path.stat().st_mtime_ns)
            else:
                most = MAX_BESIDE * (4 if path.suffix.lower() == ".gpx" else 1)  # wordier than CSV
                section[key] = read(read_text(path, most, "text", PlanError), str(path))
        except (InputError, OSError) as error:  # the latter of a name that no file can have
            place = f"{'.'.join(keys[:-1])}: {law}: {key}" if law else ".".join(keys)
            raise PlanError(f"{source}: {place}: {error}") from None
        files[keys] = str(path)
    return files


@lru_cache(maxsize=8)
def _word(path: Path, changed: int) -> str:
    """Return the word of a map's file: the page reads its plan anew at every change of it."""
    del changed
    return map_word(read_map(path))


def plain(value: Any, source: str) -> Any:
    """Return `value` as YAML has it: mappings, lists, numbers, text, true, false and null."""
    match value:
        case Mapping():
            return {str(key): plain(inside, source) for key, inside in value.items()}
        case np.ndarray() | np.generic():
            return plain(value.tolist(), source)
        case list() | tuple():
            return [plain(inside, source) for inside in value]
        case None | bool() | int() | float() | str():
            return value
        case Path():
            return str(value)
        case GainMap():
            return map_word(value)
    raise PlanError(f"{source}: {quote(value)} is not accepted; give numbers, text or lists")


def changed(data: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of `data` with the values at dotted keys replaced.

    >>> changed({"radio": {"seed": 0, "duplex": "half"}}, {"radio.seed": 7})
    {'radio': {'seed': 7, 'duplex': 'half'}}
    """
    result = dict(data)
    for path, value in changes.items():
        head, _, rest = path.partition(".")
        inside = result.get(head)
        below = inside if isinstance(inside, dict) else {}
        result[head] = changed(below, {rest: value}) if rest else value
    return result


def _describe(error: ValidationError, source: str, files: Mapping[tuple[str, ...], str]) -> str:
    """Return one line per finding (at most `_MAX_LINES`), each naming `source`.

    `files` are those that the values below some keys come from.
    """
    details = error.errors(include_url=False)
    inside = {d["loc"][:k] for d in details for k in range(len(d["loc"]))}
    # of a list whose items are wrong pydantic also says that it is too short
    own = [d for d in details if d["type"] != "too_short" or d["loc"] not in inside]
    lines = list(dict.fromkeys(_line(detail, files) for detail in own[:_MAX_LINES]))
    if len(own) > _MAX_LINES:
        lines.append(f"and {len(own) - _MAX_LINES} more")
    return "\n".join(f"{source}: {line}" for line in lines)


def _line(detail: ErrorDetails, files: Mapping[tuple[str, ...], str]) -> str:
    known, value, kind, loc = reference(), detail["input"], detail["type"], detail["loc"]
    own = loc[-1:] if kind == "unexpected_keyword_argument" else ()  # may be any text
    steps = [step for step in loc[: len(loc) - len(own)] if step not in CHOICES] + [*own]
    keys = [step for step in steps if isinstance(step, str)]
    paths = (".".join(keys[:k]) for k in range(len(keys), 0, -1))
    accepted = next((known[path].accepted for path in paths if path in known), "a mapping")
    if kind == "missing":
        problem = f"missing; give {accepted}"
    elif kind == "unexpected_keyword_argument":
        problem = unknown(".".join(keys[:-1]), keys[-1])
    elif kind == "told":
        problem = detail["msg"]
    elif kind == "value_error":
        problem = f"{quote(value)}: {detail['ctx']['error']}; give {accepted}"
    elif kind == "finite_number":
        problem = f"{value} is not a finite number; give {accepted}"
    else:
        problem = f"{quote(value)} is not accepted; give {accepted}"
    above = next((key for key in files if tuple(steps[: len(key)]) == key), ())
    where = [place_of(above), files[above]] if above else []
    return ": ".join([*filter(None, [*where, place_of(steps[len(above) :])]), problem])
