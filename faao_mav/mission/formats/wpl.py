r"""QGC WPL 110, the plain-text mission file (`.waypoints`, `.txt`).

A header line `QGC WPL 110`, then one row per item with twelve tab-separated fields: index,
current, frame, command, param1 to param4, latitude, longitude, altitude, autocontinue. Row 0 is
the home position: QGroundControl drops it, ArduPilot replaces it. Source: MAVLink developer
guide, "File formats".
"""

import math
import re
from collections.abc import Iterator

import numpy as np

from faao_mav.errors import MissionFileError
from faao_mav.mission.command import Command, Frame
from faao_mav.mission.item import Home, Mission, MissionItem

HEADER = "QGC WPL 110"

_FIELDS = (
    *("index", "current", "frame", "command", "param1", "param2", "param3", "param4"),
    *("latitude", "longitude", "altitude", "autocontinue"),
)
_INTEGER_LIMITS = {
    "index": 65_535,
    "current": 1,
    "frame": 255,
    "command": 65_535,
    "autocontinue": 1,
}
_COORDINATE_LIMITS = {"latitude": 90.0, "longitude": 180.0}

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
_INTEGER = re.compile(r"\d{1,9}", re.ASCII)
_MAX_SHOWN = 40


def write_wpl(mission: Mission) -> str:
    """Return `mission` as the text of a QGC WPL 110 file.

    Lines end in LF, row 0 is home and alone is current; a mission without home gets a row 0 of
    zeros, because readers take whatever is there for home. Numbers have at least 8 decimals and
    as many more as they need to be read back bit for bit.
    """
    home = mission.home or Home(0.0, 0.0, 0.0)
    row_0 = MissionItem(
        Command.NAV_WAYPOINT,
        Frame.GLOBAL,
        x=home.latitude,
        y=home.longitude,
        z=home.altitude,
    )
    rows = [_row(index, item) for index, item in enumerate((row_0, *mission.items))]
    return "\n".join([HEADER, *rows, ""])


def read_wpl(text: str, source: str) -> Mission:
    """Return the mission that `text`, the content of a QGC WPL 110 file, describes.

    Tolerated: spaces for tabs, CRLF or CR, a byte order mark, blank lines, lines that start with
    `#`, no newline at the end, no current item. A row 0 of zeros means that there is no home.
    A param4 (yaw) may be `nan`: not set. `source` is the file's name, for messages. Raises
    `MissionFileError` for anything else; it names line, field, value and what is expected.
    """
    lines = _lines(text)
    _check_header(next(lines, None), source)
    rows = [_Row(source, number, line) for number, line in lines]
    if not rows:
        raise MissionFileError(
            f"{source}: a header but no items; expected row 0, the home position, and the items"
        )
    current = None
    for expected, row in enumerate(rows):
        index = row.integer("index")
        if index != expected:
            raise row.error("index", f"expected {expected}: rows count up from 0, the home row")
        if row.integer("current"):
            if current is not None:
                raise row.error("current", f"expected 0: line {current} is already current")
            current = row.number
    return Mission(tuple(row.item() for row in rows[1:]), rows[0].home())


def _row(index: int, item: MissionItem) -> str:
    floats = map(_format, (*item.params, item.x, item.y, item.z))
    head = (index, int(index == 0), int(item.frame), int(item.command))
    return "\t".join([*map(str, head), *floats, str(int(item.autocontinue))])


def _format(value: float) -> str:
    return np.format_float_positional(value, unique=True, min_digits=8, trim="k")


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield line number and content of the lines that say something."""
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text.removeprefix("\ufeff")), start=1):
        content = line.strip(" \t")
        if content and not content.startswith("#"):
            yield number, content


def _check_header(line: tuple[int, str] | None, source: str) -> None:
    if line is None:
        raise MissionFileError(f"{source}: nothing in it; expected '{HEADER}' and items")
    number, content = line
    header = " ".join(content.split())
    if header == "QGC WPL 100":
        raise MissionFileError(
            f"{source}: line {number}: {header} has other fields and command numbers; "
            f"open the file in a ground station and save it as {HEADER}"
        )
    if header != HEADER:
        raise MissionFileError(f"{source}: line {number}: {_shown(content)}; expected '{HEADER}'")


class _Row:
    """A line's twelve fields, read on demand so that every complaint can name its place."""

    def __init__(self, source: str, number: int, line: str) -> None:
        self.source, self.number = source, number
        fields = re.split(r"[ \t]+", line)
        if len(fields) != len(_FIELDS):
            raise MissionFileError(
                f"{source}: line {number}: {len(fields)} fields; expected {len(_FIELDS)}, "
                f"tab-separated: {' '.join(_FIELDS)}"
            )
        self._texts = dict(zip(_FIELDS, fields, strict=True))

    def error(self, field: str, expected: str) -> MissionFileError:
        value = _shown(self._texts[field])
        return MissionFileError(
            f"{self.source}: line {self.number}, field {field}: {value}; {expected}"
        )

    def integer(self, field: str) -> int:
        limit = _INTEGER_LIMITS[field]
        text = self._texts[field]
        if not _INTEGER.fullmatch(text) or int(text) > limit:
            raise self.error(field, f"expected a whole number from 0 to {limit}")
        return int(text)

    def real(self, field: str, limit: float = math.inf) -> float:
        text = self._texts[field]
        value = float(text) if _NUMBER.fullmatch(text) else math.nan
        if not (math.isfinite(value) and abs(value) <= limit):
            span = f" from {-limit:g} to {limit:g} degrees" if limit < math.inf else ""
            raise self.error(field, f"expected a finite number{span}")
        return value

    def yaw(self) -> float:
        if self._texts["param4"].lower() == "nan":
            return math.nan
        try:
            return self.real("param4")
        except MissionFileError:
            raise self.error("param4", "expected a finite number or nan") from None

    def item(self) -> MissionItem:
        frame = self.integer("frame")
        # In the mission frame the three coordinates are plain parameters.
        limits = {} if frame == Frame.MISSION else _COORDINATE_LIMITS
        return MissionItem(
            command=self.integer("command"),
            frame=frame,
            params=(self.real("param1"), self.real("param2"), self.real("param3"), self.yaw()),
            x=self.real("latitude", limits.get("latitude", math.inf)),
            y=self.real("longitude", limits.get("longitude", math.inf)),
            z=self.real("altitude"),
            autocontinue=bool(self.integer("autocontinue")),
        )

    def home(self) -> Home | None:
        item = self.item()
        # Every reader takes row 0 for home: an item there would never be flown.
        if item.command != Command.NAV_WAYPOINT:
            raise self.error("command", "expected 16: row 0 is the home position, not an item")
        if item.frame != Frame.GLOBAL:
            raise self.error("frame", "expected 0: row 0 is the home position, not an item")
        if item.x == item.y == item.z == 0:
            return None
        return Home(item.x, item.y, item.z)


def _shown(text: str) -> str:
    return repr(text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 3] + "...")
