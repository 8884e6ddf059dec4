"""KML for Google Earth: where a mission goes, to look at. It cannot be read back.

Source: OGC KML 2.3 (07-147r2).
"""

import math
import re
from collections.abc import Iterator
from html import escape
from typing import TypeAlias

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, ABOVE_TERRAIN, FLOWN_TO, Command, Frame
from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_area import areas_of
from faao_mav.mission.formats.mission_file import left_out
from faao_mav.mission.item import Mission, MissionItem

Spot: TypeAlias = tuple[float, float, float]
"""Latitude and longitude, degrees, and altitude, metres."""

_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2">"""
_STYLES = "\n".join(
    f'<Style id="{name}"><LineStyle><color>{line}</color><width>3</width></LineStyle>'
    f"<PolyStyle><color>{filling}</color></PolyStyle></Style>"
    for name, line, filling in (
        ("route", "ff00a5ff", "00ffffff"),
        ("inclusion", "ffffffff", "00ffffff"),
        ("exclusion", "ff3232dc", "403232dc"),
    )
)
"""Styles by name: opacity, blue, green and red of the lines and of what fills areas; chosen: orange
shows on fields, towns and water, and so do a white edge and a red one."""

_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # in XML 1.0


def write_kml(mission: Mission, name: str = "mission") -> str:
    """Return a KML document of `mission`: route, waypoints and fence.

    The route is a line through the places that items fly to, the waypoints are numbered as the
    items are, from 1. Heights above home become heights above mean sea level by the mission's
    home; without one they are drawn above the ground. ArduPilot's "here" (a TAKEOFF or LAND at
    0, 0) is the place before it.
    """
    waypoints = list(_waypoints(mission))
    known = ABOVE_SEA if _ground(mission) is None else ABOVE_SEA | ABOVE_HOME
    above_sea = {item.frame for _, item, _ in waypoints} <= known
    mode = _tag("altitudeMode", "absolute" if above_sea else "relativeToGround")
    parts = [_named(name), _STYLES]
    if len(waypoints) > 1:
        way = _tag("tessellate", "1"), mode, _coordinates(*(spot for *_, spot in waypoints))
        parts.append(_placemark("Route", "route", _tag("LineString", *way)))
    points = [
        _tag("Placemark", _named(str(number)), _tag("Point", mode, _coordinates(spot)))
        for number, _, spot in waypoints
    ]
    for folder, inside in (("Waypoints", points), ("Fence", [*_areas(mission.fence)])):
        parts += [_tag("Folder", _named(folder), *inside)] if inside else []
    return "\n".join((_HEAD, _tag("Document", "\n".join(parts)), "</kml>", ""))


def kml_losses(mission: Mission, _: object) -> Iterator[str]:
    """Yield what of `mission` a KML file does not hold or show."""
    yield from left_out(mission, "KML")
    yield "KML holds route and fence alone: no commands, speeds or holds, and cannot be read back"
    frames = {item.frame for item in mission.items}
    if frames & ABOVE_TERRAIN or (_ground(mission) is None and frames & ABOVE_HOME):
        yield "heights above terrain, or above a home without a height, are drawn above the ground"
    if any(item.command == Command.NAV_SPLINE_WAYPOINT for item in mission.items):
        yield "spline waypoints are joined by straight lines"


def _waypoints(mission: Mission) -> Iterator[tuple[int, MissionItem, Spot]]:
    """Yield number, item and place of the items that fly somewhere."""
    home, ground = mission.home, _ground(mission) or 0.0
    place = None if home is None else (home.latitude, home.longitude)
    for number, item in enumerate(mission.items, start=1):
        if item.command not in FLOWN_TO or item.frame == Frame.MISSION:
            continue
        if not (item.x == item.y == 0 or math.isnan(item.x) or math.isnan(item.y)):
            place = (item.x, item.y)
        if place is not None and not math.isnan(item.z):
            yield number, item, (*place, item.z + (ground if item.frame in ABOVE_HOME else 0.0))


def _ground(mission: Mission) -> float | None:
    """Return the height of home above mean sea level, m, None where it is not known."""
    home = mission.home
    return None if home is None or math.isnan(home.altitude) else home.altitude


def _areas(fence: Fence) -> Iterator[str]:
    """Yield the areas of `fence`, on the ground, each with its kind in its name; circles too."""
    if not fence:
        return
    frame = LocalFrame(*fence.place)
    for area in areas_of(fence, frame):
        for part in shapely.get_parts(area.shape):
            outline, *holes = (_ring(ring, frame) for ring in shapely.get_rings(part))
            edges = _tag("outerBoundaryIs", outline), *(_tag("innerBoundaryIs", h) for h in holes)
            polygon = _tag("Polygon", _tag("tessellate", "1"), *edges)
            yield _placemark(area.name, "inclusion" if area.inclusion else "exclusion", polygon)


def _ring(ring: BaseGeometry, frame: LocalFrame) -> str:
    places = np.transpose(frame.to_geodetic(shapely.get_coordinates(ring))).tolist()
    return _tag("LinearRing", _coordinates(*((north, east, 0.0) for north, east in places)))


def _placemark(name: str, style: str, shape: str) -> str:
    return _tag("Placemark", _named(name), _tag("styleUrl", f"#{style}"), shape)


def _coordinates(*spots: Spot) -> str:
    """Return longitude, latitude (0.1 mm) and altitude of places."""
    drawn = (f"{east:.9f},{north:.9f},{altitude:.3f}" for north, east, altitude in spots)
    return _tag("coordinates", " ".join(drawn))


def _named(name: str) -> str:
    return _tag("name", escape(_ILLEGAL.sub("?", name)))


def _tag(name: str, *inside: str) -> str:
    return f"<{name}>{''.join(inside)}</{name}>"
