"""QGC WPL 110, the plain-text mission file (`.waypoints`, `.txt`).

A header line `QGC WPL 110`, then one row per item with twelve tab-separated fields: index,
current, frame, command, param1 to param4, latitude, longitude, altitude, autocontinue. Row 0 is
the home position: QGroundControl drops it, ArduPilot replaces it. A DO_JUMP's target is the place
of a row in the file, row 0 being home: its index, where indexes count up. Source: MAVLink developer
guide, "File formats".

A fence is a file of its own, as Mission Planner saves it from its fence screen: the home row, then
the rows of `faao_mav.mission.item`. Mission Planner drops the first row of a fence that it
loads (its pull request 2739), MAVProxy writes none.
"""

import math
import re
from collections.abc import Iterator, Sequence

import numpy as np

from faao_mav.errors import MissionFileError, counted, quote
from faao_mav.mission.command import ABOVE_HOME, CIRCLE, FENCE_RETURN_POINT, POLYGON, Command, Frame
from faao_mav.mission.fence import Fence
from faao_mav.mission.formats.mission_file import MissionFile, left_out, zeros
from faao_mav.mission.item import (
    MAX_ITEMS,
    Home,
    Mission,
    MissionItem,
    check_count,
    fence_items,
    fence_of,
    home_item,
)

HEADER = "QGC WPL 110"

_OLD_HEADERS = {
    "QGC WPL 100": ": load the file in MAVProxy (wp load) and save it (wp save)",
    "QGC WPL 120": ": open the file in QGroundControl and save it, which gives a .plan",
}
"""What to do with files of earlier versions, by their header."""

_PARAMS = ("param1", "param2", "param3", "param4")
_WHOLE = {"index": 65_535, "current": 1, "frame": 255, "command": 65_535, "autocontinue": 1}
"""The fields of a row that are whole numbers, and the largest of each."""

_DEGREES = {"latitude": 90, "longitude": 180}
_FIELDS = (*list(_WHOLE)[:4], *_PARAMS, *_DEGREES, "altitude", "autocontinue")

_FENCE = frozenset({FENCE_RETURN_POINT, *POLYGON.values(), *CIRCLE.values()})
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)


def write_wpl(mission: Mission) -> str:
    """Return `mission` as the text of a QGC WPL 110 file.

    Lines end in LF, row 0 is home and alone is current; a mission without home gets a row 0 of
    zeros, because readers take whatever is there for home. Numbers have at least 8 decimals and
    as many more as they need to be read back bit for bit. NaN is written as 0, and the rally
    points are left out. The fence is another file: `write_wpl_fence`.
    """
    return _text(mission.home, mission.items)


def wpl_losses(mission: Mission, _: object) -> Iterator[str]:
    """Yield what of `mission` the files do not hold."""
    yield from left_out(mission, "QGC WPL")
    yield from zeros(mission, for_nan=True)
    if mission.home is not None and math.isnan(mission.home.altitude):
        yield "the altitude of home is not known: the file says 0 m"


def write_wpl_fence(mission: Mission, comment: str) -> str:
    """Return the fence of `mission` as the text of a QGC WPL 110 file, with a `comment`."""
    return _text(mission.home, fence_items(mission.fence), f"# {comment}")


def _text(home: Home | None, items: Sequence[MissionItem], *comments: str) -> str:
    rows = [_row(index, item) for index, item in enumerate((home_item(home), *items))]
    return "\n".join([HEADER, *comments, *rows, ""])


def _row(index: int, item: MissionItem) -> str:
    head = (index, int(index == 0), int(item.frame), int(item.command))
    floats = (0.0 if math.isnan(value) else value for value in item.numbers)
    shown = (np.format_float_positional(v, unique=True, min_digits=8, trim="k") for v in floats)
    return "\t".join([*map(str, head), *shown, str(int(item.autocontinue))])


def read_wpl(text: str) -> MissionFile:
    """Return the mission that `text`, the content of a QGC WPL 110 file, describes.

    Tolerated: spaces for tabs, CRLF or CR, a byte order mark, blank lines, lines that start with
    `#`, no newline at the end, no current item, a home row of command 0 (Mission Planner). A row
    0 of zeros means that there is no home. A parameter may be `nan`: not set. Tolerated with a
    warning, because autopilots' own tests have them: indexes that do not count up (rows are taken
    in the file's order, as pymavlink takes them) and a home row in a frame above home. Raises
    `MissionFileError` for anything else; it names line, field, value and what is expected.
    """
    rows = _rows(text)
    current = [row for row in rows if row.current]
    if len(current) > 1:
        raise current[1].wrong("current", f"0: line {current[0].number} is already current")
    mission = Mission(tuple(row.item for row in rows[1:]), rows[0].home())
    return MissionFile(mission, warnings=tuple(_oddities(rows, mission)))


def read_wpl_fence(text: str) -> Fence:
    """Return the fence that `text`, the content of a QGC WPL file of fence items, describes.

    A first row that is no fence item is the home row. What is tolerated is as in `read_wpl`.
    """
    rows = _rows(text)
    if rows[0].item.command not in _FENCE:
        rows.pop(0).home()
    for row in rows:
        if row.item.command not in _FENCE:
            raise row.wrong("command", "5000 to 5004: a file of a fence holds no others")
    return fence_of([row.item for row in rows])


def _oddities(rows: "Sequence[_Row]", mission: Mission) -> Iterator[str]:
    """Yield what is odd about a file that is read nevertheless."""
    if rows[0].item.frame in ABOVE_HOME and mission.home is not None:
        told = "row 0 is the home position; its altitude is taken as above mean sea level"
        yield f"{rows[0].place('frame')}: {told}"
    odd = [row for index, row in enumerate(rows) if row.index != index]
    if odd:
        jumps = any(item.command == Command.DO_JUMP for item in mission.items)
        too = ", in which targets of DO_JUMP count too" if jumps else ""
        told = f"indexes do not count up; rows are taken in the file's order{too}"
        yield f"{odd[0].place('index')}: {told}"


def _rows(text: str) -> "list[_Row]":
    """Return the rows under the header, one at least, without lines that say nothing."""
    lines = [
        (number, line.strip(" \t"))
        for number, line in enumerate(re.split(r"\r\n|\n|\r", text), start=1)
        if line.strip(" \t") and not line.lstrip(" \t").startswith("#")
    ]
    if not lines:
        raise MissionFileError(f"nothing in it; expected '{HEADER}' and items")
    (number, header), *rest = lines
    if " ".join(header.split()) != HEADER:
        advice = _OLD_HEADERS.get(" ".join(header.split()), "")
        raise MissionFileError(f"line {number}: {quote(header)}; expected '{HEADER}'{advice}")
    if not rest:
        raise MissionFileError(
            "a header but no items; expected row 0, the home position, and the items"
        )
    check_count(len(rest) - 1, "items", MAX_ITEMS)
    return [_Row(number, line) for number, line in rest]


class _Row:
    """A row of the file: its item, and what else its fields say; `number` is that of its line."""

    def __init__(self, number: int, line: str) -> None:
        self.number, texts = number, re.split(r"[ \t]+", line)
        if len(texts) != len(_FIELDS):
            raise MissionFileError(
                f"line {number}: {counted(len(texts), 'field')}; expected {len(_FIELDS)}, "
                f"tab-separated: {' '.join(_FIELDS)}"
            )
        self._texts = dict(zip(_FIELDS, texts, strict=True))
        whole = {field: self._whole(field, most) for field, most in _WHOLE.items()}
        self.index, self.current = whole["index"], whole["current"]
        # In the mission frame the three coordinates are plain parameters.
        limits = {} if whole["frame"] == Frame.MISSION else _DEGREES
        reals = [self._real(field, limits.get(field, math.inf)) for field in _FIELDS[4:-1]]
        a, b, c, d, x, y, z = reals
        self.item = MissionItem(
            whole["command"], whole["frame"], (a, b, c, d), x, y, z, bool(whole["autocontinue"])
        )

    def place(self, field: str) -> str:
        return f"line {self.number}, field {field}: {quote(self._texts[field])}"

    def wrong(self, field: str, expected: str) -> MissionFileError:
        return MissionFileError(f"{self.place(field)}; expected {expected}")

    def _whole(self, field: str, most: int) -> int:
        text = self._texts[field]
        if not (text.isascii() and text.isdigit() and float(text) <= most):
            raise self.wrong(field, f"a whole number from 0 to {most}")
        return int(text)

    def _real(self, field: str, most: float) -> float:
        text = self._texts[field]
        if field in _PARAMS and text.lower() == "nan":
            return math.nan
        value = float(text) if _NUMBER.fullmatch(text) else math.nan
        if not (math.isfinite(value) and abs(value) <= most):
            span = f" from {-most} to {most} degrees" if most < math.inf else ""
            point = " with a decimal point, not a comma" if "," in text else ""
            unset = " or nan" if field in _PARAMS else ""
            raise self.wrong(field, f"a finite number{point}{span}{unset}")
        return value

    def home(self) -> Home | None:
        # Every reader takes row 0 for home: an item there would never be flown.
        if self.item.command not in (Command.NAV_WAYPOINT, 0):
            raise self.wrong("command", "16: row 0 is the home position, not an item")
        if self.item.frame not in (Frame.GLOBAL, *ABOVE_HOME):
            raise self.wrong("frame", "0: row 0 is the home position, not an item")
        place = self.item.x, self.item.y, self.item.z
        return Home(*place) if any(place) else None
