"""Where a station is: at a place, on a line at a velocity, or on a track with times."""

import math
from datetime import UTC, datetime
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from pydantic import PlainValidator, ValidationInfo
from pydantic_core import PydanticCustomError

from faao_mav.arrays import Real
from faao_mav.errors import InputError, MissionFileError, PlanError, quote
from faao_mav.files import read_columns
from faao_mav.plan.fields import PLACE, Number, read_position, section, told
from faao_mav.vector import Vector

MAX_POINTS = 5_000
"""Points of the longest track; chosen: 80 minutes of one a second."""

FASTEST = 150.0
"""Greatest speed of a station, m/s; chosen: no train, boat or relayed aircraft is as fast."""

_LOCAL, _GLOBAL = ("time_s", "east_m", "north_m"), ("time_s", "latitude", "longitude")
"""The columns of a track."""


class Track(NamedTuple):
    """A way with times: at `times`, s after the first, at `places` [east, north], m.

    It is straight and even between two of them.
    """

    times: tuple[float, ...]
    places: tuple[Vector, ...]


def read_track(text: str, path: str) -> str:
    """Return the track in the `text` of the file `path`, .csv or .gpx, as the plan has it.

    That is a table with `time_s` and its place in two more columns; of a .gpx, seconds after the
    first point of all tracks. Raises `PlanError` that names the point for what is no GPX.

    Source: GPX 1.1, trkpt and its time, ISO 8601.
    """
    if not path.lower().endswith(".gpx"):
        return text
    from faao_mav.mission.formats.fence_file import xml_tree  # plans rarely have one

    try:
        found = list(xml_tree(text.encode()).iter("trkpt"))
    except MissionFileError as error:
        raise PlanError(f"{path}: {error}") from None
    rows, first = [",".join(_GLOBAL)], 0.0
    for number, point in enumerate(found, 1):
        when, lat, lon = point.findtext("time") or "", point.get("lat", ""), point.get("lon", "")
        try:
            moment = datetime.fromisoformat(when.strip())
            t = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
            first = t if number == 1 else first
            rows.append(f"{t - first:.11g},{float(lat):.11g},{float(lon):.11g}")
        except (ValueError, OverflowError):
            raise PlanError(
                f"{path}: point {number}: lat {quote(lat)}, lon {quote(lon)}, time {quote(when)}; "
                "give degrees, and a time as 2026-05-01T12:00:00Z"
            ) from None
    return "\n".join([*rows, ""])


def _track(value: object, info: ValidationInfo) -> Track | None:
    if value is None:
        return None
    if not isinstance(value, str):
        raise ValueError("no file")
    try:
        _, held = read_columns(value, (_LOCAL, _GLOBAL))
    except InputError as error:
        raise told(str(error)) from None
    times, *sides = held.values()
    if not 2 <= len(times) <= MAX_POINTS:
        raise told(f"points with a time: {len(times):,}; give 2 to {MAX_POINTS:,}")
    before, places = -math.inf, []
    for number, (t, *place) in enumerate(zip(times, *sides, strict=True), 1):
        written = dict(zip(_GLOBAL[1:], place, strict=True)) if "latitude" in held else place
        try:
            places.append(read_position(written, info))
        except (ValueError, PydanticCustomError) as error:
            raise told(f"point {number}: {error}") from None
        if not (math.isfinite(t) and t > before):
            raise told(f"point {number}: time {t:g} s; give finite times that rise")
        if places[1:] and math.dist(*places[-2:]) > FASTEST * (t - before):
            raise told(f"point {number}: more than {FASTEST:g} m/s from the point before")
        before = t
    return Track(tuple(t - times[0] for t in times), tuple(places))


def _place(value: object, info: ValidationInfo) -> Vector:
    """Return the place at the start: that of the track where none is given."""
    if "track" not in info.data:  # it is refused itself
        return 0.0, 0.0
    track: Track | None = info.data["track"]
    if track is None and value is None:
        raise PydanticCustomError("missing", "missing")
    if track is not None and value is not None:
        raise told(f"{quote(value)}: track is given too; leave one out")
    return read_position(value, info) if track is None else track.places[0]


_OF_TRACK: Any = None
_Place: TypeAlias = Annotated[Vector, PlainValidator(_place), PLACE]


@section
class Station:
    """A station, which stands or moves.

    >>> import numpy as np
    >>> Station(position=(0.0, 50.0), velocity=(5.0, 0.0)).at(np.array([0.0, 10.0])).tolist()
    [[0.0, 50.0], [50.0, 50.0]]
    """

    track: Annotated[Track | None, PlainValidator(_track)] = None
    position: _Place = _OF_TRACK
    velocity: tuple[Number, Number] = (0.0, 0.0)

    @property
    def moves(self) -> bool:
        """Whether it does not stay where it is at the start."""
        return self.track is not None or any(self.velocity)

    def at(self, t: Real) -> Real:
        """Return its places (n, 2), m, at `t` (n,), s on the plan's clock.

        Beyond the ends of a track it is at its ends.
        """
        if self.track is None:
            return np.asarray(np.array(self.position) + np.outer(t, self.velocity))
        return np.stack(
            [np.interp(t, self.track.times, side) for side in zip(*self.track.places, strict=True)],
            axis=1,
        )
