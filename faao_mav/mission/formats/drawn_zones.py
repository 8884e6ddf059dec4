"""The polygons of a drawing (KML, GeoJSON) as zones of a fence: to stay in or out, as words tell.

Nobody is let fly into a zone for want of a word: a polygon whose words tell neither, or both, is an
error that says how to tell.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import shapely

from faao_mav.errors import InputError, MissionFileError, quote
from faao_mav.mission.fence import Fence, LatLon, Polygon, check_outlines

_NOT_DENIED = r"(?<!\bnot )(?<!\bnon )(?<!\bun )\b"

_OUT = re.compile(
    _NOT_DENIED + r"(exclusions?|excluded?|exclusive(?! use)|no ?fly\w*|nfz\d*|no ?go|keep ?out|"
    r"stay ?out|restricted|prohibited|forbidden|danger|no (entry|drones?|flying|flights?)|"
    r"do not (fly|enter)|not (allowed|permitted))\b"
)
"""Whole words of a zone to stay out of, as `_folded` leaves them."""

_IN = re.compile(
    _NOT_DENIED + r"(inclusions?|included?|inclusive|keep ?in|stay ?in|unrestricted|allowed|"
    r"permitted|exclusive use)\b"
)
"""Whole words of a zone to stay in that contradict those of `_OUT`."""

_FIELD = re.compile(
    r"\b(field|fence|geofence|(flight|flying|operati\w+|mission|working) (area|zone|volume|site))\b"
)
"""Whole words of a zone to stay in, where none of `_OUT` says what kind of one it is: "restricted
field", "exclusion fence"."""

_TRUTH = dict.fromkeys(("true", "1", "yes"), True) | dict.fromkeys(("false", "0", "no"), False)
"""What words of a property say, in lower case."""

_HOW = (
    "name it as an inclusion or an exclusion, or give it a property inclusion: true (stay in) or "
    "false (stay out)"
)

Ring = list[LatLon]
"""The corners of an outline or of a hole."""


@dataclass(frozen=True)
class DrawnZone:
    """A zone of a drawing: its polygons, each an outline and holes, and what is said of it.

    A corner is longitude, latitude and what else a drawing has, as numbers or texts. `place` is
    where the zone stands in the file, for messages; `properties` are its own, `around` the names of
    what it is in.
    """

    place: str
    name: str
    properties: Mapping[str, object]
    around: Sequence[str]
    parts: Sequence[Sequence[Sequence[Sequence[object]]]]


def fence_of(zones: Iterable[DrawnZone]) -> Fence:
    """Return the fence of `zones`; holes of an inclusion are exclusions.

    The parts of an inclusion are one area, which autopilots would intersect: they are joined. The
    fence's notes name the polygons without corners, passed over. Raises `MissionFileError` for what
    is no corner, for a zone of which nothing tells whether to stay in or out, and for an exclusion
    with a hole, which no autopilot has; `InputError` as `Fence` does.
    """
    polygons: list[Polygon] = []
    notes = []
    for zone in zones:
        try:
            parts = [[_ring(ring) for ring in part] for part in zone.parts]
            drawn = [part for part in parts if part and part[0]]
            polygons += _polygons(zone, drawn) if drawn else []
        except InputError as error:
            raise MissionFileError(f"{zone.place}: {error}") from None
        except TypeError:  # of what is no list
            raise MissionFileError(f"{zone.place}: expected lists of corners") from None
        if len(drawn) < len(parts):
            name = f" {quote(zone.name)}" if zone.name else ""
            notes.append(f"{zone.place}{name}: a polygon without corners, passed over")
    return Fence(tuple(polygons), notes=tuple(notes))


def _ring(told: Sequence[Sequence[object]]) -> Ring:
    """Return the corners of a ring, without the last one where that is the first again."""
    ring = [_corner(each) for each in told]
    return ring[:-1] if ring[:1] == ring[-1:] else ring


def _corner(told: Any) -> LatLon:
    try:
        longitude, latitude = map(float, told[:2] if isinstance(told, list) else ())
    except (TypeError, ValueError, OverflowError):
        raise MissionFileError(f"{quote(told)}; expected longitude, latitude in degrees") from None
    return latitude, longitude


def _polygons(zone: DrawnZone, parts: list[list[Ring]]) -> Iterator[Polygon]:
    inclusion = _inclusion(zone)
    if inclusion:
        parts = _joined(parts)
    elif any(len(part) > 1 for part in parts):
        raise MissionFileError("an exclusion with a hole, which no autopilot knows; cut it in two")
    for outline, *holes in parts:
        yield Polygon(tuple(outline), inclusion, zone.name)
        for hole in holes:
            yield Polygon(tuple(hole), False, f"hole of {zone.name}" if zone.name else "")


def _inclusion(zone: DrawnZone) -> bool:
    """Return whether the aircraft is to stay in the zone: as a property or else its words tell."""
    texts = [zone.name, *zone.around]
    for key, told in zone.properties.items():
        truth = _TRUTH.get(str(told).strip().casefold())
        if told is not None and key.casefold() in ("inclusion", "exclusion"):
            if truth is None:
                raise MissionFileError(f"property {key}: {quote(told)}; expected true or false")
            return truth is (key.casefold() == "inclusion")
        texts += [told] if isinstance(told, str) else []
        texts += [key] if truth else []
    meaning = _meaning(texts)
    if meaning is None:
        raise MissionFileError(
            f"{quote(zone.name)}: nothing tells whether to stay in it or out of it; {_HOW}"
        )
    return meaning


def _meaning(texts: Sequence[str]) -> bool | None:
    """Return whether `texts` tell to stay in, False to stay out, None for neither.

    Raises `MissionFileError` where they tell both.

    >>> _meaning(["No-Fly_Zone 3"]), _meaning(["unrestricted area"]), _meaning(["School"])
    (False, True, None)
    """
    folded = " | ".join(map(_folded, texts))
    out, inside = _OUT.search(folded), _IN.search(folded)
    if out and inside:
        shown = ", ".join(quote(text) for text in texts if text)
        raise MissionFileError(
            f"{shown} tells both to stay in ({inside[1]}) and to stay out ({out[1]}); {_HOW}"
        )
    return False if out else True if inside or _FIELD.search(folded) else None


def _folded(text: str) -> str:
    """Return the words of `text` in lower case, parted by one space each: `NoFly-Zone` is three.

    >>> _folded("NoFly-Zone_2")
    'no fly zone 2'
    """
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    return " ".join(re.findall(r"[^\W_]+", parted.casefold()))


def _joined(parts: list[list[Ring]]) -> list[list[Ring]]:
    """Return the union of `parts`, each an outline and its holes, also across the date line."""
    if len(parts) == 1:
        return parts
    check_outlines([Polygon(tuple(ring), True) for part in parts for ring in part])
    first = parts[0][0][0][1]
    shapes = []
    for part in parts:
        rings = [[(north, first + _turn(east - first)) for north, east in ring] for ring in part]
        shapes.append(shapely.Polygon(rings[0], rings[1:]))
        if not shapely.is_valid(shapes[-1]):
            raise MissionFileError("a part crosses or touches itself; put its corners in order")
    return [
        [[(n, _turn(e)) for n, e in ring.coords[:-1]] for ring in shapely.get_rings(each)]
        for each in shapely.get_parts(shapely.union_all(shapes))
    ]


def _turn(degrees: float) -> float:
    """Return an angle as one of -180 to 180 degrees."""
    return degrees if abs(degrees) <= 180 else (degrees + 180) % 360 - 180
