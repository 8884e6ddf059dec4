"""Files of autopilot parameters: `.param`, `.parm` and QGroundControl's `.params`.

Most ground stations write `NAME,VALUE` or `NAME VALUE`. QGroundControl writes five fields between
tabs, which people align by spaces: system, component, name, value and MAV_PARAM_TYPE. In both,
lines that start with `#` are comments. As read by Mission Planner, pymavlink (MAVProxy) and
QGroundControl.
"""

import math
import re
from collections.abc import Iterator, Mapping
from decimal import Decimal
from pathlib import Path
from typing import Literal, TypeAlias

from faao_mav.errors import ParameterFileError, quote
from faao_mav.files import read_text

ParameterStyle: TypeAlias = Literal["list", "qgroundcontrol"]
"""`NAME,VALUE`, or QGroundControl's five fields."""

MAX_BYTES = 4_000_000
"""Bytes of the largest file that is read; chosen: ten times what the largest autopilot has."""

_AUTOPILOT_COMPONENT = 1
"""MAV_COMP_ID_AUTOPILOT1: the component whose parameters are read."""

_INT32, _REAL32 = 6, 9
"""MAV_PARAM_TYPE of what is written; those of 8, 16, 32 and 64 bits are read."""

_INTEGERS, _TYPES = range(1, 9), range(1, 11)
"""MAV_PARAM_TYPE of integers, and all of them."""

_INT32_LIMITS = range(-(2**31), 2**31)

_READ_ONLY = "@READONLY"
"""What MAVProxy writes behind a parameter that cannot be set."""

_NAME = re.compile(r"[A-Z][A-Z0-9_]{0,15}", re.ASCII)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
_HEXADECIMAL = re.compile(r"0x[0-9a-f]{1,8}", re.ASCII | re.IGNORECASE)
_COMMA = re.compile(r"\d,\d")
_WHOLE = re.compile(r"\d{1,3}", re.ASCII)


def read_parameters(path: str | Path) -> dict[str, float]:
    """Return the parameters in the file `path` by name, in the file's order.

    Both formats are told apart by their lines, so the name's ending does not matter. What
    QGroundControl's file calls an integer is an `int`, all else a `float`; parameters of other
    components than the autopilot (1) are passed over. Tolerated: spaces, tabs or commas, CRLF, a
    byte order mark, blank lines, comments at the end of a line, hexadecimal values, `@READONLY`.
    Raises `ParameterFileError` for anything else, naming file, line and value; for a name that
    has two values; for no parameters.
    """
    text = read_text(path, MAX_BYTES, "a file of parameters", ParameterFileError)
    result: dict[str, float] = {}
    lines: dict[str, int] = {}
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text), start=1):
        for name, value in _parameter(line, f"{path}: line {number}"):
            if result.setdefault(name, value) != value:
                raise ParameterFileError(
                    f"{path}: line {number}: {name} {value:g}; line {lines[name]} says "
                    f"{result[name]:g}: remove one"
                )
            lines.setdefault(name, number)
    if not result:
        raise ParameterFileError(f"{path}: no parameters in it; expected lines of NAME,VALUE")
    return result


def render_parameters(
    parameters: Mapping[str, float],
    style: ParameterStyle = "list",
    *,
    header: str = "",
    system: int = 1,
) -> str:
    """Return the text of a parameter file, with the lines of `header` as comments before them.

    In the style "qgroundcontrol" an `int` is an INT32 and a `float` a REAL32, so 5 and 5.0
    differ: QGroundControl refuses the wrong one, and, if it is connected, a `system` that is not
    the vehicle's. Values have as many digits as they need. Raises `ParameterFileError` for names
    and values that no autopilot has.

    >>> print(render_parameters({"WPNAV_SPEED": 800.0, "WPNAV_JERK": 1.5}), end="")
    WPNAV_SPEED,800
    WPNAV_JERK,1.5
    """
    for name, value in parameters.items():
        if not _NAME.fullmatch(name):
            raise ParameterFileError(
                f"parameter {quote(name)}; expected at most 16 capitals, digits and _"
            )
        if not math.isfinite(value) or (isinstance(value, int) and value not in _INT32_LIMITS):
            raise ParameterFileError(
                f"parameter {name}: {value}; expected a finite number, an integer within 32 bits"
            )
    comments = [f"# {line}".rstrip() for line in header.splitlines()]
    if style == "qgroundcontrol":
        comments += [*(["#"] if header else []), "# Vehicle-Id Component-Id Name Value Type"]
        rows = [
            "\t".join((str(system), str(_AUTOPILOT_COMPONENT), name, _digits(value), _type(value)))
            for name, value in parameters.items()
        ]
    else:
        rows = [f"{name},{_digits(value)}" for name, value in parameters.items()]
    return "\n".join([*comments, *rows, ""])


def _digits(value: float) -> str:
    """Return the shortest decimal, without exponent, that is read back as `value`."""
    number = int(value) if isinstance(value, int) else float(value)
    return format(Decimal(repr(number)), "f").removesuffix(".0")


def _type(value: float) -> str:
    return str(_INT32 if isinstance(value, int) else _REAL32)


def _parameter(line: str, where: str) -> Iterator[tuple[str, float]]:
    """Yield the parameter of a line, nothing for a line without one."""
    content = line.partition("#")[0].strip()
    if not content:
        return
    fields = re.split(r"[ \t]*,[ \t]*|[ \t]+", content)
    if len(fields) == 5:
        _, component, name, text, kind = fields
        if not _WHOLE.fullmatch(component):
            raise ParameterFileError(f"{where}: component {quote(component)}; expected a number")
        if not _WHOLE.fullmatch(kind) or int(kind) not in _TYPES:
            raise ParameterFileError(f"{where}: type {quote(kind)}; expected a number 1 to 10")
        if int(component) == _AUTOPILOT_COMPONENT:
            _check_name(name, where)
            yield name, _number(text, where, whole=int(kind) in _INTEGERS)
        return
    if fields[-1] == _READ_ONLY:
        fields.pop()
    if len(fields) != 2:
        comma = "; numbers have a decimal point, no comma" if _COMMA.search(content) else ""
        raise ParameterFileError(
            f"{where}: {quote(content)}; expected NAME,VALUE or NAME VALUE, or five fields: "
            f"system, component, name, value, type{comma}"
        )
    _check_name(fields[0], where)
    yield fields[0], _number(fields[1], where, whole=False)


def _check_name(name: str, where: str) -> None:
    if not _NAME.fullmatch(name):
        raise ParameterFileError(
            f"{where}: name {quote(name)}; expected at most 16 capitals, digits and _"
        )


def _number(text: str, where: str, *, whole: bool) -> float:
    if _HEXADECIMAL.fullmatch(text):
        value = float(int(text, 16))
    else:
        value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(value) or (whole and value != int(value)):
        kind = "a whole number, as its type says" if whole else "a finite number"
        raise ParameterFileError(f"{where}: value {quote(text)}; expected {kind}")
    return int(value) if whole else value
