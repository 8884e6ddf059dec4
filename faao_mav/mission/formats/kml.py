"""KML for Google Earth: where a mission goes, to look at. It cannot be read back.

Source: OGC KML 2.3 (07-147r2) and Google's extension `gx:Track`.
"""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Literal, TypeAlias
from xml.etree import ElementTree as Xml

from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, FLOWN_TO, Command, Frame
from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_area import areas_of
from faao_mav.mission.item import Home, Mission, MissionItem

AltitudeMode: TypeAlias = Literal["absolute", "relativeToGround"]
Spot: TypeAlias = tuple[float, float, float]
"""Latitude and longitude, degrees, and altitude, metres."""

_KML = "http://www.opengis.net/kml/2.2"
_GX = "http://www.google.com/kml/ext/2.2"
_STYLES = (
    ("route", "ff00a5ff", None),
    ("inclusion", "ffffffff", "00ffffff"),
    ("exclusion", "ff3232dc", "403232dc"),
)
"""Styles by name: opacity, blue, green and red of the lines and of what fills areas; chosen: orange
shows on fields, towns and water, and so do a white edge and a red one."""

_LINE_WIDTH = 3
"""Width of lines in pixels; chosen by eye."""

_DECIMALS = 9
"""Decimals of a degree: 0.1 mm."""

_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # in XML 1.0


@dataclass(frozen=True, slots=True)
class Station:
    """A radio station or another place to mark: degrees, metres above mean sea level."""

    name: str
    latitude: float
    longitude: float
    altitude: float


@dataclass(frozen=True, slots=True)
class TimedTrack:
    """A flight as predicted or flown: where it is and when.

    `t`, seconds, counts from `start`; `spots` are as many places, with metres above mean sea
    level. Raises `InputError` for lengths that differ and a `start` without a time zone.
    """

    start: datetime
    t: Sequence[float]
    spots: Sequence[Spot]

    def __post_init__(self) -> None:
        if len(self.t) != len(self.spots):
            raise InputError(f"track: {len(self.t)} times for {len(self.spots)} places")
        if self.start.tzinfo is None:
            raise InputError(f"track: start {self.start.isoformat()}; expected a time zone")


def write_kml(
    mission: Mission,
    *,
    name: str = "mission",
    stations: Sequence[Station] = (),
    track: TimedTrack | None = None,
) -> str:
    """Return a KML document of `mission`: route, numbered waypoints, fence, stations, a flight.

    The route is a line through the places that items fly to, the waypoints are numbered as the
    items are, from 1. Heights above home become heights above mean sea level by the mission's
    home; without one they are drawn above the ground. ArduPilot's "here" (a TAKEOFF or LAND at
    0, 0) is the place before it. `track` moves along Google Earth's time slider.
    """
    Xml.register_namespace("", _KML)
    Xml.register_namespace("gx", _GX)
    root = Xml.Element(_tag("kml"))
    document = _add(root, "Document")
    _add(document, "name", name)
    for name, color, filling in _STYLES:
        style = _add(document, "Style", id=name)
        line = _add(style, "LineStyle")
        _add(line, "color", color)
        _add(line, "width", str(_LINE_WIDTH))
        if filling is not None:
            _add(_add(style, "PolyStyle"), "color", filling)

    waypoints = list(_waypoints(mission))
    mode = _mode(mission)
    if len(waypoints) > 1:
        _add_line(document, [spot for _, _, spot in waypoints], mode)
    if waypoints:
        folder = _add(document, "Folder")
        _add(folder, "name", "Waypoints")
        for number, item, spot in waypoints:
            _add_point(folder, str(number), spot, mode, _description(item))
    if mission.fence:
        _add_fence(document, mission.fence)
    for station in stations:
        spot = (station.latitude, station.longitude, station.altitude)
        _add_point(document, station.name, spot, "absolute")
    if track is not None:
        _add_track(document, track)
    Xml.indent(root)
    body = Xml.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'


def _waypoints(mission: Mission) -> Iterator[tuple[int, MissionItem, Spot]]:
    """Yield number, item and place of the items that fly somewhere."""
    home = mission.home
    place = (home.latitude, home.longitude) if home else None
    for number, item in enumerate(mission.items, start=1):
        if item.command not in FLOWN_TO or item.frame == Frame.MISSION:
            continue
        if not (item.x == item.y == 0 or math.isnan(item.x) or math.isnan(item.y)):
            place = (item.x, item.y)
        if place is not None and not math.isnan(item.z):
            yield number, item, (*place, _altitude(item, home))


def _altitude(item: MissionItem, home: Home | None) -> float:
    if home is None or math.isnan(home.altitude) or item.frame not in ABOVE_HOME:
        return item.z
    return item.z + home.altitude


def _mode(mission: Mission) -> AltitudeMode:
    frames = {item.frame for item in mission.items if item.command in FLOWN_TO}
    known = ABOVE_SEA | ABOVE_HOME if mission.home else ABOVE_SEA
    return "absolute" if frames <= known else "relativeToGround"


def _description(item: MissionItem) -> str:
    name = Command(item.command).name.removeprefix("NAV_").replace("_", " ").lower()
    hold = item.params[0]
    held = item.command in (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT) and hold > 0
    return f"{name}, hold {hold:g} s" if held else name


def _placemark(
    parent: Xml.Element, name: str, *, style: str | None = None, description: str | None = None
) -> Xml.Element:
    placemark = _add(parent, "Placemark")
    _add(placemark, "name", name)
    if style is not None:
        _add(placemark, "styleUrl", f"#{style}")
    if description is not None:
        _add(placemark, "description", description)
    return placemark


def _add_line(document: Xml.Element, spots: Sequence[Spot], mode: AltitudeMode) -> None:
    line = _add(_placemark(document, "Route", style="route"), "LineString")
    _add(line, "tessellate", "1")
    _add(line, "altitudeMode", mode)
    _add(line, "coordinates", " ".join(_coordinates(spot, ",") for spot in spots))


def _add_point(
    parent: Xml.Element, name: str, spot: Spot, mode: AltitudeMode, description: str | None = None
) -> None:
    point = _add(_placemark(parent, name, description=description), "Point")
    _add(point, "altitudeMode", mode)
    _add(point, "coordinates", _coordinates(spot, ","))


def _add_fence(document: Xml.Element, fence: Fence) -> None:
    """Add the areas of `fence`, on the ground, each with its kind in its name; circles too."""
    import shapely

    folder = _add(document, "Folder")
    _add(folder, "name", "Fence")
    frame = LocalFrame(*fence.place)
    for area in areas_of(fence, frame):
        kind = "inclusion" if area.inclusion else "exclusion"
        for part in shapely.get_parts(area.shape):
            polygon = _add(_placemark(folder, area.name, style=kind), "Polygon")
            _add(polygon, "tessellate", "1")
            for n, ring in enumerate(shapely.get_rings(part)):
                boundary = _add(polygon, "innerBoundaryIs" if n else "outerBoundaryIs")
                latitudes, longitudes = frame.to_geodetic(shapely.get_coordinates(ring))
                spots = zip(latitudes.tolist(), longitudes.tolist(), strict=True)
                places = " ".join(_coordinates((*spot, 0.0), ",") for spot in spots)
                _add(_add(boundary, "LinearRing"), "coordinates", places)


def _add_track(document: Xml.Element, track: TimedTrack) -> None:
    placemark = _placemark(document, "Flight", style="route")
    line = Xml.SubElement(placemark, f"{{{_GX}}}Track")
    _add(line, "altitudeMode", "absolute")
    for seconds in track.t:
        moment = (track.start + timedelta(seconds=float(seconds))).astimezone(UTC)
        _add(line, "when", moment.isoformat(timespec="milliseconds").replace("+00:00", "Z"))
    for spot in track.spots:
        Xml.SubElement(line, f"{{{_GX}}}coord").text = _coordinates(spot, " ")


def _coordinates(spot: Spot, separator: str) -> str:
    latitude, longitude, altitude = spot
    places = (f"{longitude:.{_DECIMALS}f}", f"{latitude:.{_DECIMALS}f}", f"{altitude:.3f}")
    return separator.join(places)


def _add(parent: Xml.Element, tag: str, text: str | None = None, **attributes: str) -> Xml.Element:
    element = Xml.SubElement(parent, _tag(tag), attributes)
    element.text = None if text is None else _ILLEGAL.sub("?", text)
    return element


def _tag(name: str) -> str:
    return f"{{{_KML}}}{name}"
