"""The keys of `plan.yaml`: what each means and accepts."""

import difflib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from faao_mav.plan.fields import listed
from faao_mav.plan.model import PlanContents

POWER = "power_dbm"
"""The key of a study that stands for the powers of the base station and of the relay."""

ALIASES = {POWER: ("radio.base_station.power_dbm", "radio.relay.power_dbm")}
"""Keys of a study that stand for several of the plan."""

_UNIT_WORDS = {"m": "metres", "s": "seconds"}


@dataclass(frozen=True, slots=True)
class PlanKey:
    """One key of a plan.

    `path` has dots between the keys, `default` is what the file would say (empty: nothing, or the
    key is `required`), `accepted` completes "give ...", `inside` are the keys of a section, and
    `choices` the words that are accepted, empty where any other value is.
    """

    path: str
    description: str
    unit: str
    default: str
    required: bool
    accepted: str
    inside: tuple[str, ...] = ()
    choices: tuple[str, ...] = ()


def reference() -> Mapping[str, PlanKey]:
    """Return every key of a plan by its path, sections before what is in them.

    >>> key = reference()["radio.relay.power_dbm"]
    >>> key.description, key.unit, key.default, key.accepted
    ('Transmit power W_U.', 'dBm', '20', 'a power from -200 to 100 dBm')
    >>> reference()["mission.max_items"].accepted
    'a whole number, 2 to 65535'
    """
    return {key.path: key for key in _below(PlanContents, "")}


def _below(section: type, prefix: str) -> Iterator[PlanKey]:
    for field in fields(section):
        if not field.init:
            continue
        of: Any = field.type
        info = FieldInfo.from_annotated_attribute(of, field)
        extra: Any = info.json_schema_extra or {"unit": "", "accepted": ""}
        path = prefix + (info.alias or field.name)
        inner = list(_sections(info.annotation))
        below = [key for one in inner for key in _below(one, f"{path}.")]
        names = (key.path.removeprefix(f"{path}.") for key in below)
        inside = tuple(name for name in names if "." not in name)
        required = info.is_required()
        default = None if required or inside else info.get_default(call_default_factory=True)
        yield PlanKey(
            path,
            info.description or inner[0].__doc__.partition("\n")[0],
            extra["unit"],
            _as_yaml(default),
            required,
            extra["accepted"] or _accepted(info, extra["unit"], inside),
            inside,
            _choices(info.annotation),
        )
        yield from below


def _sections(annotation: Any) -> Iterator[Any]:
    if hasattr(annotation, "__pydantic_config__"):
        yield annotation
    for part in get_args(annotation):
        yield from _sections(part)


def _choices(annotation: Any) -> tuple[str, ...]:
    if annotation is bool:
        return ("true", "false")
    if get_origin(annotation) is Literal:
        return get_args(annotation)
    if type(None) in get_args(annotation):
        return _choices(get_args(annotation)[0])
    return ()


def _as_yaml(value: object) -> str:
    """Return a default as a plan's file would have it; nothing for None."""
    match value:
        case bool():
            return str(value).lower()
        case tuple():
            return f"[{', '.join(map(_as_yaml, value))}]"
        case int() | float():
            return f"{value:g}".replace("e+0", "e")
        case Mapping():
            return "{}"
    return "" if value is None else str(value) or '""'


def _accepted(info: FieldInfo, unit: str, inside: tuple[str, ...]) -> str:
    """Return in words what type and limits of a key accept."""
    kind: Any = info.annotation
    for said in info.metadata:  # by its type
        if isinstance(said, str) or callable(said):
            return said if isinstance(said, str) else listed(said())
    if inside:
        return f"a mapping with {', '.join(inside)}"
    if choices := _choices(kind):
        return listed(choices)
    if get_origin(kind) is tuple:
        return f"a list of {listed(_choices(get_args(kind)[0]), 'and')}"
    number = "a whole number" if kind is int else "a number"
    of = f" of {_UNIT_WORDS.get(unit, unit)}" if unit else ""
    limits = {n: getattr(m, n) for m in info.metadata for n in ("gt", "ge", "le") if hasattr(m, n)}
    low = f" above {limits['gt']:g}, at most" if "gt" in limits else f", {limits['ge']:g} to"
    return f"{number}{of}{low} {limits['le']:g}"


def unknown(above: str, name: str) -> str:
    """Return that the section `above` has no key `name`, and the known keys near it.

    >>> unknown("radio", "modulaton")
    'unknown key; did you mean modulation?'
    """
    beside = [each.rpartition(".")[2] for each in reference() if each.rpartition(".")[0] == above]
    close = difflib.get_close_matches(name, beside, n=1)
    close = close or [each for each in reference() if each.rpartition(".")[2] == name]
    if close:
        return f"unknown key; did you mean {' or '.join(close)}?"
    return f"unknown key; known here: {', '.join(sorted(beside))}"
