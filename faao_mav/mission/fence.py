"""Geofences and rally points: what travels beside a mission."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, TypeAlias

import numpy as np

from faao_mav.arrays import Complex
from faao_mav.errors import InputError

LatLon: TypeAlias = tuple[float, float]
"""Latitude and longitude, WGS84 degrees."""

MAX_CORNERS = 8_192
"""Corners and circles of a fence, in all: ArduPilot keeps 8 bytes for each in at most 64 kB of its
card (BRD_SD_FENCE), without a card 84 of them, and PX4 64 to 128."""

_MAX_AREAS = 255
"""Polygons or circles of a fence, to stay in or out of: ArduPilot counts each of these four kinds
in 8 bits."""

MAX_CROSSINGS = 50_000
"""Places at which the outlines of a fence may cross themselves or each other. Chosen: to find what
areas leave that cross so often takes a second and 150 MB, five times as often 10 s and 400 MB."""


def check_place(place: LatLon, what: str, altitude: float = 0.0) -> None:
    """Raise `InputError`, which names `what`, for coordinates that are no place on Earth.

    An `altitude` of NaN is one that is not known.
    """
    latitude, longitude = place
    if not (abs(latitude) <= 90 and abs(longitude) <= 180):
        raise InputError(
            f"{what}: {latitude}, {longitude}; expected a latitude within 90 degrees and a "
            "longitude within 180"
        )
    if math.isinf(altitude):
        raise InputError(f"{what}: altitude {altitude}; expected finite metres")


@dataclass(frozen=True, slots=True)
class Circle:
    """All places within `radius` metres of `center`; to stay in (`inclusion`) or out of.

    `name` as in `Polygon`. Raises `InputError` for a center that is no place on Earth or a radius
    that is not above 0.
    """

    center: LatLon
    radius: float
    inclusion: bool
    name: str = ""

    def __post_init__(self) -> None:
        check_place(self.center, "fence circle")
        if not (math.isfinite(self.radius) and self.radius > 0):
            raise InputError(f"fence circle: radius {self.radius}; expected metres above 0")


@dataclass(frozen=True, slots=True)
class Polygon:
    """The inside of `vertices`, at least three; to stay in (`inclusion`) or out of.

    `name` is what a drawing calls it, which no autopilot is told. Raises `InputError` for fewer
    vertices or one that is no place on Earth.
    """

    vertices: tuple[LatLon, ...]
    inclusion: bool
    name: str = ""

    def __post_init__(self) -> None:
        if len(self.vertices) < 3:
            raise InputError(f"fence polygon: {len(self.vertices)} vertices; expected at least 3")
        for vertex in self.vertices:
            check_place(vertex, "fence polygon")


@dataclass(frozen=True, slots=True)
class Point:
    """A place: WGS84 degrees, and an altitude, m, NaN where it is not known.

    Raises `InputError` for coordinates that are no place on Earth, and says what it is `called`.
    """

    latitude: float
    longitude: float
    altitude: float
    called: ClassVar[str]

    def __post_init__(self) -> None:
        check_place((self.latitude, self.longitude), self.called, self.altitude)

    @property
    def on_ground(self) -> tuple[float, float, float]:
        """Latitude, longitude and altitude, 0 where that is not known."""
        altitude = 0.0 if math.isnan(self.altitude) else self.altitude
        return self.latitude, self.longitude, altitude


@dataclass(frozen=True, slots=True)
class RallyPoint(Point):
    """A place to return to instead of home: its altitude counts from home."""

    called = "rally point"


@dataclass(frozen=True, slots=True)
class Fence:
    """Where the aircraft may be: inside every inclusion, outside every exclusion.

    `breach_return` is where ArduPilot flies after a breach, or None. `notes` tell what of a drawing
    was passed over. A fence without areas is false. Raises `InputError` for more of anything than
    any autopilot keeps.

    >>> bool(Fence(circles=(Circle((47.4, 8.5), 300.0, inclusion=True),))), bool(Fence())
    (True, False)
    """

    polygons: tuple[Polygon, ...] = ()
    circles: tuple[Circle, ...] = ()
    breach_return: RallyPoint | None = None
    notes: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        for kind, count in Counter(map(kind_of, self.areas)).items():
            if count > _MAX_AREAS:
                raise InputError(
                    f"fence: {count:,} {kind}s; at most {_MAX_AREAS} are accepted, as many as an "
                    "autopilot tells apart"
                )
        check_outlines(self.areas)

    @property
    def areas(self) -> tuple[Polygon | Circle, ...]:
        """The polygons, then the circles."""
        return (*self.polygons, *self.circles)

    def __bool__(self) -> bool:
        return bool(self.areas)

    @property
    def place(self) -> LatLon:
        """A place of the fence, to count metres from; raises IndexError without areas."""
        return self.polygons[0].vertices[0] if self.polygons else self.circles[0].center


def kind_of(area: Polygon | Circle) -> str:
    """Return which of the four kinds of areas it is, as in "exclusion circle"."""
    shape = "polygon" if isinstance(area, Polygon) else "circle"
    return f"{'inclusion' if area.inclusion else 'exclusion'} {shape}"


def check_outlines(areas: Sequence[Polygon | Circle]) -> None:
    """Raise `InputError` for more than `MAX_CORNERS`, or more than `MAX_CROSSINGS`."""
    corners = sum(len(area.vertices) if isinstance(area, Polygon) else 1 for area in areas)
    if corners > MAX_CORNERS:
        raise InputError(
            f"fence: {corners:,} corners and circles; at most {MAX_CORNERS:,} are accepted, as "
            "many as an autopilot keeps: simplify it"
        )
    if _crossings(areas) > MAX_CROSSINGS:
        raise InputError(
            f"fence: its outlines cross at more than {MAX_CROSSINGS:,} places; draw areas that "
            "do not cross themselves, and each other once or twice"
        )


def _crossings(areas: Sequence[Polygon | Circle]) -> int:
    """Return at how many places the outlines of `areas` cross, not counted beyond `MAX_CROSSINGS`.

    Outlines that touch, or run along each other, do not cross there. Fewer edges than may cross
    more often are not looked at.
    """
    rings = [_corners(area) for area in areas]
    if sum(map(len, rings)) ** 2 <= 2 * MAX_CROSSINGS:
        return 0
    begin, end = np.concatenate(rings), np.concatenate([np.roll(ring, -1) for ring in rings])
    along, crossings = (end - begin).conj(), 0
    for k in range(len(begin)):
        others, others_end = begin[k + 1 :], end[k + 1 :]
        sides = (along[k] * (others - begin[k])).imag * (along[k] * (others_end - begin[k])).imag
        own = along[k + 1 :] * (begin[k] - others), along[k + 1 :] * (end[k] - others)
        crossings += int(np.count_nonzero((sides < 0) & (own[0].imag * own[1].imag < 0)))
        if crossings > MAX_CROSSINGS:
            break
    return crossings


def _corners(area: Polygon | Circle) -> Complex:
    """Return the corners of `area`, degrees north plus j times degrees east; of a circle 16."""
    if isinstance(area, Polygon):
        corners = np.array(area.vertices) @ (1, 1j)
    else:
        turn = np.exp(2j * np.pi * np.arange(16) / 16) * min(area.radius / 111_000, 90)
        shrunk = max(math.cos(math.radians(area.center[0])), 1e-3)
        corners = complex(*area.center) + turn.real + 1j * turn.imag / shrunk
    east = (corners.imag - corners[0].imag + 180) % 360 - 180  # across the date line
    return np.asarray(corners.real + 1j * (corners[0].imag + east))
