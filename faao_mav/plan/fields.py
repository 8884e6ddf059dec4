"""How a section of `plan.yaml` is declared, and the types that its keys are read as.

A section is a class; a key is a field of it, with its type and, as the file says it, its default:

    @section
    class Flight:
        duration: Number
        time_step: Number = 0.2

`keys.tsv` says what each key means, its name in the file if another than the field's, and which
numbers it may have in which unit: `(0, 1e7] s`, where `(` leaves the lower end out. People write
decibels and degrees; the plan holds watts, linear gains and local metres. What is accepted follows
from type and interval (`keys.reference`) unless the table, or a text among the type's annotations,
says it in words.
"""

import json
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Annotated, Any, TypeAlias, TypeVar, dataclass_transform

from pydantic import (
    AfterValidator,
    AllowInfNan,
    Field,
    PlainValidator,
    Strict,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    with_config,
)
from pydantic_core import PydanticCustomError

from faao_mav.files import table
from faao_mav.geodesy import LocalFrame
from faao_mav.vector import Vector

MAX_LOCAL_DISTANCE = 100_000.0
"""Largest distance of a position from the origin in metres: the frame is flat to 0.01 % there."""

MIN_DBM = -200.0
"""Least transmit power, dBm; chosen: no link carries anything there."""

_INTERVAL = re.compile(r"([\[(])(\S+), (\S+)\] ?(.*)")
"""An interval, which has its upper end, and a unit: `(0, 1000] m/s`."""

_Section = TypeVar("_Section")

_DECLARED = {(row["section"], row["field"]): row for row in table("plan/keys.tsv")}


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field,))
def section(cls: type[_Section]) -> type[_Section]:
    """Make a class of keys a frozen dataclass that is read from a mapping of these keys alone."""
    made = dataclass(frozen=True, slots=True, kw_only=True)(cls)
    for each in fields(made):  # type: ignore[arg-type]
        if row := _DECLARED.get((cls.__name__, each.name)):
            found, said = _INTERVAL.fullmatch(row["values"]), {"unit": row["values"]}
            limits: dict[str, Any] = {}
            if found:
                begins, low, high, said["unit"] = found.groups()
                limits = {"gt" if begins == "(" else "ge": json.loads(low), "le": json.loads(high)}
            limits |= {"description": row["means"], "alias": row["key"] or None}
            said["accepted"] = row["accepted"]
            each.metadata = MappingProxyType({**limits, "json_schema_extra": said})
    return with_config(extra="forbid", validate_default=True, defer_build=True)(made)


DEFAULTS: Any = dict
"""Makes a section of which the file says nothing: each key has its default."""

Number: TypeAlias = Annotated[float, Strict(), AllowInfNan(False)]
Whole: TypeAlias = Annotated[int, Strict()]
Flag: TypeAlias = Annotated[bool, Strict()]


Text: TypeAlias = Annotated[str, Strict(), Field(pattern=r"^( |[^\p{C}\p{Z}])*$")]
"""Text in one line, without characters that move a terminal's cursor."""


def listed(words: Sequence[str], last: str = "or") -> str:
    """Return `words` as a sentence has them.

    >>> listed(["bpsk", "qpsk", "8psk"])
    'bpsk, qpsk or 8psk'
    """
    return f" {last} ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def one_of(names: Callable[[], tuple[str, ...]]) -> PlainValidator:
    """Check that a value is one of the `names` known when it is read."""

    def check(value: object) -> object:
        if value not in names():
            raise PydanticCustomError("unknown_name", "is none of the names")
        return value

    return PlainValidator(check)


def watts(dbm: float) -> float:
    """Return a power in watts of `dbm`: 10^((dbm - 30) / 10).

    >>> watts(20.0)
    0.1
    """
    return float(10 ** ((dbm - 30) / 10))


def dbm(power: float) -> float:
    """Return `power`, W, in dBm."""
    return 10 * math.log10(power) + 30


def linear(db: float) -> float:
    """Return the linear gain of `db`: 10^(db / 10)."""
    return float(10 ** (db / 10))


def told(reason: str) -> PydanticCustomError:
    """Return an error whose message is `reason` alone."""
    return PydanticCustomError("told", "{reason}", {"reason": reason})


_PAIR: TypeAdapter[Vector] = TypeAdapter(tuple[Number, Number])


def read_pair(value: object, expected: str) -> Vector:
    """Return two finite numbers; raise ValueError that says what is `expected` for others."""
    try:
        return _PAIR.validate_python(value)
    except ValidationError:
        raise ValueError(f"not two finite numbers {expected}") from None


def check_degrees(latitude: float, longitude: float) -> None:
    """Raise ValueError unless both are on the globe; say so when they look swapped."""
    if not abs(latitude) <= 90:
        swapped = abs(longitude) <= 90 and abs(latitude) <= 180
        hint = "; latitude and longitude look swapped" if swapped else ""
        raise ValueError(f"latitude {latitude} is outside -90..90 degrees{hint}")
    if not abs(longitude) <= 180:
        raise ValueError(f"longitude {longitude} is outside -180..180 degrees")


def read_position(value: object, info: ValidationInfo) -> Vector:
    """Return the local metres of a position as a plan writes it; raise ValueError for others."""
    if not isinstance(value, dict):
        east, north = read_pair(value, "[east, north] in metres")
        if max(abs(east), abs(north)) > MAX_LOCAL_DISTANCE:
            raise ValueError(f"farther than {MAX_LOCAL_DISTANCE / 1000:.0f} km from the origin")
        return east, north
    both = [value.get("latitude"), value.get("longitude")] if len(value) == 2 else None
    place = read_pair(both, "{latitude: degrees, longitude: degrees}")
    check_degrees(*place)
    context: Any = info.context
    if (origin := context.get("origin")) is None:  # a bad one is told by itself
        return 0.0, 0.0
    east, north = map(float, LocalFrame(*origin).to_local(*place))
    if (distance := math.hypot(east, north)) <= MAX_LOCAL_DISTANCE:
        return east, north
    raise told(
        f"latitude {place[0]}, longitude {place[1]} lies {distance / 1000:,.0f} km from "
        f"site.origin ({origin[0]}, {origin[1]}), at most {MAX_LOCAL_DISTANCE / 1000:.0f} km is "
        "accepted; are the two swapped, or a sign forgotten: south and west are negative"
    )


def _velocity(value: object) -> Vector | None:
    if value in ("hover", "free"):
        return (0.0, 0.0) if value == "hover" else None
    return read_pair(value, "[east, north] in m/s")


Problem: TypeAlias = tuple[str, dict[str, Any]]
"""What keys that do not agree have wrong: a row of `problems.tsv`, and the values said there."""


def wrong(row: str, **values: Any) -> Problem:
    """Return that the problem of a `row` is there, with `values` for its text."""
    return row, values


PLACE = "[east, north] in metres or {latitude: degrees, longitude: degrees}"

Position: TypeAlias = Annotated[Vector, PlainValidator(read_position), PLACE]
Velocity: TypeAlias = Annotated[
    Vector | None, PlainValidator(_velocity), "hover, free or [east, north] in m/s"
]
Power: TypeAlias = Annotated[
    Number, Field(ge=MIN_DBM, le=100), AfterValidator(watts), "a power from -200 to 100 dBm"
]
Noise: TypeAlias = Annotated[
    Number, Field(ge=-250, le=100), AfterValidator(watts), "a noise power from -250 to 100 dBm"
]
Gain: TypeAlias = Annotated[
    Number,
    Field(ge=-200, le=0),
    AfterValidator(linear),
    "a gain from -200 to 0 dB (1e-5, linear, is -50)",
]
Antennas: TypeAlias = Annotated[Whole, Field(ge=1, le=64), "a whole number of antennas, 1 to 64"]
