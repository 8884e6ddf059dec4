r"""QGC WPL 110, the plain-text mission file (`.waypoints`, `.txt`).

A header line `QGC WPL 110`, then one row per item with twelve tab-separated fields: index,
current, frame, command, param1 to param4, latitude, longitude, altitude, autocontinue. Row 0 is
the home position: QGroundControl drops it, ArduPilot replaces it. A DO_JUMP's target is the place
of a row in the file, row 0 being home: its index, where indexes count up. Source: MAVLink developer
guide, "File formats".

A fence is a file of its own, as Mission Planner saves it from its fence screen: the home row, then
the rows of `faao_mav.mission.fence_items`. Mission Planner drops the first row of a fence that it
loads (its pull request 2739), MAVProxy writes none.

Read, but not written: `QGC WPL 120`, QGroundControl's rows without a home row, and `QGC WPL 100`,
thirteen fields in another order with command numbers of MAVLink before 1.0, as pymavlink reads it.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from faao_mav.errors import InputError, MissionFileError, quote
from faao_mav.mission.command import ABOVE_HOME, CIRCLE, FENCE_RETURN_POINT, POLYGON, Command, Frame
from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_items import fence_items, fence_of
from faao_mav.mission.formats.mission_file import MissionFile
from faao_mav.mission.item import (
    MAX_ITEMS,
    Home,
    Mission,
    MissionItem,
    check_count,
    home_item,
    jump_moved,
)

HEADER = "QGC WPL 110"


@dataclass(frozen=True, slots=True)
class _Layout:
    """What the rows under a header hold."""

    fields: tuple[str, ...]
    home_row: bool = True
    commands: Mapping[int, int] = field(default_factory=dict)  # in the file: MAV_CMD


_PARAMS = ("param1", "param2", "param3", "param4")
_FIELDS = (
    *("index", "current", "frame", "command", *_PARAMS),
    *("latitude", "longitude", "altitude", "autocontinue"),
)
_FIELDS_100 = (
    *("index", "frame", "command", "param3", "param4", "param1", "param2", "current"),
    *("longitude", "latitude", "altitude", "yaw", "autocontinue"),
)
_COMMANDS_100 = {
    2: Command.NAV_TAKEOFF,
    3: Command.NAV_RETURN_TO_LAUNCH,
    4: Command.NAV_LAND,
    24: Command.NAV_TAKEOFF,
    25: Command.NAV_WAYPOINT,
    26: Command.NAV_LAND,
    27: Command.NAV_LOITER_UNLIM,
}
_LAYOUTS = {
    HEADER: _Layout(_FIELDS),
    "QGC WPL 120": _Layout(_FIELDS, home_row=False),
    "QGC WPL 100": _Layout(_FIELDS_100, commands=_COMMANDS_100),
}
_FENCE = frozenset({FENCE_RETURN_POINT, *POLYGON.values(), *CIRCLE.values()})
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


def write_wpl(mission: Mission) -> str:
    """Return `mission` as the text of a QGC WPL 110 file.

    Lines end in LF, row 0 is home and alone is current; a mission without home gets a row 0 of
    zeros, because readers take whatever is there for home. Numbers have at least 8 decimals and
    as many more as they need to be read back bit for bit. NaN is written as 0, and the rally
    points are left out: `losses` tells. The fence is another file: `write_wpl_fence`.
    """
    return _text(mission.home, mission.items)


def write_wpl_fence(mission: Mission, comment: str) -> str:
    """Return the fence of `mission` as the text of a QGC WPL 110 file, with a `comment`.

    Numbers are those of `write_wpl`.
    """
    return _text(mission.home, fence_items(mission.fence), f"# {comment}")


def _text(home: Home | None, items: Sequence[MissionItem], *comments: str) -> str:
    rows = [_row(index, item) for index, item in enumerate((home_item(home), *items))]
    return "\n".join([HEADER, *comments, *rows, ""])


def read_wpl(text: str, source: str) -> MissionFile:
    """Return the mission that `text`, the content of a QGC WPL file, describes.

    Tolerated: spaces for tabs, CRLF or CR, a byte order mark, blank lines, lines that start with
    `#`, no newline at the end, no current item, a home row of command 0 (Mission Planner). A row
    0 of zeros means that there is no home. A parameter may be `nan`: not set. Tolerated with a
    warning, because autopilots' own tests have them: indexes that do not count up (rows are taken
    in the file's order, as pymavlink takes them) and a home row in a frame above home. `source` is
    the file's name, for messages. Raises `MissionFileError` for anything else; it names line,
    field, value and what is expected.
    """
    layout, rows = _rows(text, source)
    current = None
    for row in rows:
        if row.integer("current"):
            if current is not None:
                raise row.error("current", f"expected 0: line {current} is already current")
            current = row.number
    if layout.home_row:
        mission = Mission(tuple(row.item() for row in rows[1:]), rows[0].home())
    else:
        mission = Mission(tuple(jump_moved(row.item(), 1) for row in rows))
    return MissionFile(mission, warnings=tuple(_oddities(rows, layout, mission)))


def read_wpl_fence(text: str, source: str) -> Fence:
    """Return the fence that `text`, the content of a QGC WPL file of fence items, describes.

    A first row that is no fence item is the home row. What is tolerated is as in `read_wpl`.
    """
    _, rows = _rows(text, source)
    if rows[0].command() not in _FENCE:
        rows[0].home()
        rows = rows[1:]
    for row in rows:
        if row.command() not in _FENCE:
            raise row.error("command", "expected 5000 to 5004: a file of a fence holds no others")
    try:
        return fence_of([row.item() for row in rows])
    except InputError as error:
        raise MissionFileError(f"{source}: {error}") from None


def _rows(text: str, source: str) -> "tuple[_Layout, list[_Line]]":
    """Return the layout that the header names, and the rows under it: one at least."""
    lines = _lines(text)
    layout = _layout(next(lines, None), source)
    told = list(lines)
    try:
        check_count(len(told) - layout.home_row, "items", MAX_ITEMS)
    except InputError as error:
        raise MissionFileError(f"{source}: {error}") from None
    rows = [_Line(source, number, line, layout) for number, line in told]
    if not rows:
        first = "row 0, the home position, and the items" if layout.home_row else "items"
        raise MissionFileError(f"{source}: a header but no items; expected {first}")
    return layout, rows


def _oddities(rows: "Sequence[_Line]", layout: _Layout, mission: Mission) -> Iterator[str]:
    """Yield what is odd about a file that is read nevertheless."""
    if layout.home_row and rows[0].integer("frame") in ABOVE_HOME and mission.home is not None:
        yield rows[0].place("frame") + (
            ": row 0 is the home position; its altitude is taken as above mean sea level"
        )
    odd = [row for place, row in enumerate(rows) if row.integer("index") != place]
    if odd:
        jumps = any(item.command == Command.DO_JUMP for item in mission.items)
        yield odd[0].place("index") + (
            ": indexes do not count up; rows are taken in the file's order"
            f"{', in which targets of DO_JUMP count too' if jumps else ''}"
        )


def _row(index: int, item: MissionItem) -> str:
    floats = map(_format, (*item.params, item.x, item.y, item.z))
    head = (index, int(index == 0), int(item.frame), int(item.command))
    return "\t".join([*map(str, head), *floats, str(int(item.autocontinue))])


def _format(value: float) -> str:
    if math.isnan(value):
        value = 0.0
    return np.format_float_positional(value, unique=True, min_digits=8, trim="k")


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield line number and content of the lines that say something."""
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text), start=1):
        content = line.strip(" \t")
        if content and not content.startswith("#"):
            yield number, content


def _layout(line: tuple[int, str] | None, source: str) -> _Layout:
    if line is None:
        raise MissionFileError(f"{source}: nothing in it; expected '{HEADER}' and items")
    number, content = line
    layout = _LAYOUTS.get(" ".join(content.split()))
    if layout is None:
        raise MissionFileError(f"{source}: line {number}: {quote(content)}; expected '{HEADER}'")
    return layout


class _Line:
    """A line's fields, read on demand so that every complaint can name its place."""

    def __init__(self, source: str, number: int, line: str, layout: _Layout) -> None:
        self.source, self.number, self._commands = source, number, layout.commands
        fields = re.split(r"[ \t]+", line)
        if len(fields) != len(layout.fields):
            raise MissionFileError(
                f"{source}: line {number}: {len(fields)} fields; expected {len(layout.fields)}, "
                f"tab-separated: {' '.join(layout.fields)}"
            )
        self._texts = dict(zip(layout.fields, fields, strict=True))

    def place(self, field: str) -> str:
        value = quote(self._texts[field])
        return f"{self.source}: line {self.number}, field {field}: {value}"

    def error(self, field: str, expected: str) -> MissionFileError:
        return MissionFileError(f"{self.place(field)}; {expected}")

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
            point = " with a decimal point, not a comma" if "," in text else ""
            raise self.error(field, f"expected a finite number{point}{span}")
        return value

    def param(self, field: str) -> float:
        if self._texts[field].lower() == "nan":
            return math.nan
        try:
            return self.real(field)
        except MissionFileError:
            raise self.error(field, "expected a finite number or nan") from None

    def command(self) -> int:
        number = self.integer("command")
        if not self._commands:
            return number
        if number not in self._commands:
            known = ", ".join(map(str, self._commands))
            raise self.error("command", f"expected one of {known}: the header says QGC WPL 100")
        return self._commands[number]

    def item(self) -> MissionItem:
        frame = self.integer("frame")
        # In the mission frame the three coordinates are plain parameters.
        limits = {} if frame == Frame.MISSION else _COORDINATE_LIMITS
        param1, param2, param3, param4 = map(self.param, _PARAMS)
        return MissionItem(
            command=self.command(),
            frame=frame,
            params=(param1, param2, param3, param4),
            x=self.real("latitude", limits.get("latitude", math.inf)),
            y=self.real("longitude", limits.get("longitude", math.inf)),
            z=self.real("altitude"),
            autocontinue=bool(self.integer("autocontinue")),
        )

    def home(self) -> Home | None:
        # Every reader takes row 0 for home: an item there would never be flown.
        if self.integer("command") != 0 and self.command() != Command.NAV_WAYPOINT:
            raise self.error("command", "expected 16: row 0 is the home position, not an item")
        if self.integer("frame") not in (Frame.GLOBAL, *ABOVE_HOME):
            raise self.error("frame", "expected 0: row 0 is the home position, not an item")
        latitude, longitude = (self.real(name, limit) for name, limit in _COORDINATE_LIMITS.items())
        altitude = self.real("altitude")
        if latitude == longitude == altitude == 0:
            return None
        return Home(latitude, longitude, altitude)
