"""Files of autopilot parameters: `.param`, `.parm` and QGroundControl's `.params`.

Most ground stations write `NAME,VALUE` or `NAME VALUE`. QGroundControl writes five fields between
tabs, which people align by spaces: system, component, name, value and MAV_PARAM_TYPE. In both,
lines that start with `#` are comments. As read by Mission Planner, pymavlink (MAVProxy) and
QGroundControl.
"""

import math
import re
from collections.abc import Mapping
from decimal import Decimal
from pathlib import Path
from typing import Literal

from faao_mav.errors import ParameterFileError, quote
from faao_mav.files import read_text

MAX_BYTES = 4_000_000
"""Bytes of the largest file that is read; chosen: ten times what the largest autopilot has."""

_AUTOPILOT = "1"  # MAV_COMP_ID_AUTOPILOT1: the component whose parameters are read and written.

_INT32, _REAL32 = 6, 9
"""MAV_PARAM_TYPE of what is written; those of 8, 16, 32 and 64 bits are read, integers up to 8."""

_READ_ONLY = "@READONLY"  # What MAVProxy writes behind a parameter that cannot be set.

_NAME = re.compile(r"[A-Z][A-Z0-9_]{0,15}", re.ASCII)
_NAMED = "expected at most 16 capitals, digits and _"
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
_HEXADECIMAL = re.compile(r"0x[0-9a-f]{1,8}", re.ASCII | re.IGNORECASE)


def read_parameters(path: str | Path) -> dict[str, float]:
    """Return the parameters in the file `path` by name, in the file's order.

    Both formats are told apart by their lines, so the name's ending does not matter. What
    QGroundControl's file calls an integer is an `int`, all else a `float`; parameters of other
    components than the autopilot (1) are passed over. Tolerated: spaces, tabs or commas, CRLF, a
    byte order mark, blank lines, comments at the end of a line, hexadecimal values, `@READONLY`.
    Raises `ParameterFileError` for anything else, naming file, line and value; for a name that
    has two values; for no parameters.

    >>> read_parameters("README.md")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    faao_mav.errors.ParameterFileError: README.md: line 3: ...
    """
    text = read_text(path, MAX_BYTES, "a file of parameters", ParameterFileError)
    result: dict[str, float] = {}
    lines: dict[str, int] = {}
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text), start=1):
        content, where = line.partition("#")[0].strip(), f"{path}: line {number}"
        name, value = _parameter(content, where) if content else ("", 0.0)
        if name and result.setdefault(name, value) != value:
            raise ParameterFileError(
                f"{where}: {name} {value:g}; line {lines[name]} says {result[name]:g}: remove one"
            )
        lines.setdefault(name, number)
    if not result:
        raise ParameterFileError(f"{path}: no parameters in it; expected lines of NAME,VALUE")
    return result


def _parameter(content: str, where: str) -> tuple[str, float]:
    """Return the parameter of a line, no name for one of another component."""
    fields = re.split(r"[ \t]*,[ \t]*|[ \t]+", content)
    if fields[-1] == _READ_ONLY:
        fields.pop()
    component, kind = _AUTOPILOT, str(_REAL32)
    if len(fields) == 5:
        _, component, *fields, kind = fields
    if len(fields) != 2:
        comma = "; numbers have a decimal point, no comma" if re.search(r"\d,\d", content) else ""
        raise ParameterFileError(
            f"{where}: {quote(content)}; expected NAME,VALUE or NAME VALUE, or five fields: "
            f"system, component, name, value, type{comma}"
        )
    name, text = fields
    if kind not in map(str, range(1, 11)):
        raise ParameterFileError(f"{where}: type {quote(kind)}; expected a number 1 to 10")
    if component != _AUTOPILOT and component.isdecimal():
        return "", 0.0
    if component != _AUTOPILOT:
        raise ParameterFileError(f"{where}: component {quote(component)}; expected a number")
    if not _NAME.fullmatch(name):
        raise ParameterFileError(f"{where}: name {quote(name)}; {_NAMED}")
    whole = int(kind) < _REAL32
    if _HEXADECIMAL.fullmatch(text):
        value = float(int(text, 16))
    else:
        value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(value) or (whole and value % 1):
        expected = "a whole number, as its type says" if whole else "a finite number"
        raise ParameterFileError(f"{where}: value {quote(text)}; expected {expected}")
    return name, int(value) if whole else value


def render_parameters(
    parameters: Mapping[str, float],
    style: Literal["list", "qgroundcontrol"] = "list",
    *,
    header: str = "",
) -> str:
    """Return the text of a parameter file, with the lines of `header` as comments before them.

    In the style "qgroundcontrol" an `int` is an INT32 and a `float` a REAL32, so 5 and 5.0
    differ: QGroundControl refuses the wrong one. Values have as many digits as they need. Raises
    `ParameterFileError` for names and values that no autopilot has.

    >>> print(render_parameters({"WPNAV_SPEED": 800.0, "WPNAV_JERK": 1.5}), end="")
    WPNAV_SPEED,800
    WPNAV_JERK,1.5
    """
    lines = [f"# {line}".rstrip() for line in header.splitlines()]
    if style == "qgroundcontrol":
        lines += [*(["#"] if header else []), "# Vehicle-Id Component-Id Name Value Type"]
    for name, value in parameters.items():
        whole = isinstance(value, int)
        if not _NAME.fullmatch(name):
            raise ParameterFileError(f"parameter {quote(name)}; {_NAMED}")
        if not math.isfinite(value) or (whole and not -(2**31) <= value < 2**31):
            raise ParameterFileError(
                f"parameter {name}: {value}; expected a finite number, an integer within 32 bits"
            )
        # the shortest decimal, without exponent, that is read back as the value
        digits = format(Decimal(repr(value)), "f").removesuffix(".0")
        kind = _INT32 if whole else _REAL32
        row = f"1\t{_AUTOPILOT}\t{name}\t{digits}\t{kind}"
        lines.append(row if style == "qgroundcontrol" else f"{name},{digits}")
    return "\n".join([*lines, ""])
