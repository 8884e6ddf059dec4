"""The polygons of a drawing (KML, GeoJSON) as zones of a fence: to stay in or out, as words tell.

Nobody is let fly into a zone for want of a word: a polygon whose words tell neither, or both, is an
error that says how to tell.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

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

_TRUE, _FALSE = ("true", "1", "yes"), ("false", "0", "no")

_HOW = (
    "name it as an inclusion or an exclusion, or give it a property inclusion: true (stay in) or "
    "false (stay out)"
)

Ring = list[LatLon]
"""The corners of an outline or of a hole."""


@dataclass(frozen=True)
class DrawnZone:
    """A zone of a drawing: its polygons, each an outline and holes, and what is said of it.

    `place` is where it stands in the file, for messages; `properties` are its own, `around` the
    names of what it is in.
    """

    place: str
    name: str
    properties: Mapping[str, object]
    around: Sequence[str]
    parts: Sequence[Sequence[Ring]]

    def polygons(self) -> list[Polygon]:
        """Return the zone as polygons of a fence; holes of an inclusion are exclusions.

        The parts of an inclusion are one area, which autopilots would intersect: they are joined.
        Raises `MissionFileError` for a zone of which nothing tells whether to stay in or out, and
        for an exclusion with a hole, which no autopilot has; `InputError` as `Polygon` does.
        """
        try:
            inclusion = self._inclusion()
            outlines = [(part[0], part[1:]) for part in self.parts]
            if inclusion:
                outlines = _joined(outlines)
            elif any(holes for _, holes in outlines):
                raise MissionFileError(
                    "an exclusion with a hole, which no autopilot knows; cut it in two"
                )
            return [
                *(Polygon(_open(ring), inclusion, self.name) for ring, _ in outlines),
                *(
                    Polygon(_open(hole), False, f"hole of {self.name}" if self.name else "")
                    for _, holes in outlines
                    for hole in holes
                ),
            ]
        except InputError as error:
            raise MissionFileError(f"{self.place}: {error}") from None

    def _inclusion(self) -> bool:
        """Return whether the aircraft is to stay in the zone."""
        for key, meaning in (("inclusion", True), ("exclusion", False)):
            told = next((v for k, v in self.properties.items() if k.casefold() == key), None)
            if told is not None:
                return _truth(told, key) == meaning
        texts = [value for value in self.properties.values() if isinstance(value, str)]
        true = [k for k, v in self.properties.items() if str(v).strip().casefold() in _TRUE]
        own = _meaning([self.name, *texts, *true])
        around = _meaning(self.around)
        if own is None:
            own = around
        elif own and around is False:
            raise MissionFileError(
                f"{quote(self.name)} is to stay in, what it is in ({_shown(self.around)}) to stay "
                f"out; {_HOW}"
            )
        if own is None:
            raise MissionFileError(
                f"{quote(self.name)}: nothing tells whether to stay in it or out of it; {_HOW}"
            )
        return own


def _meaning(texts: Iterable[str]) -> bool | None:
    """Return whether `texts` tell to stay in, False to stay out, None for neither.

    Raises `MissionFileError` where they tell both.

    >>> _meaning(["No-Fly_Zone 3"]), _meaning(["unrestricted area"]), _meaning(["School"])
    (False, True, None)
    """
    kept = list(texts)
    folded = " | ".join(_folded(text) for text in kept)
    out, inside = _OUT.search(folded), _IN.search(folded)
    if out and inside:
        raise MissionFileError(
            f"{_shown(kept)} tells both to stay in ({inside[1]}) and to stay out ({out[1]}); {_HOW}"
        )
    if out:
        return False
    return True if inside or _FIELD.search(folded) else None


def _folded(text: str) -> str:
    """Return the words of `text` in lower case, parted by one space each: `NoFly-Zone` is three.

    >>> _folded("NoFly-Zone_2")
    'no fly zone 2'
    """
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    return " ".join(re.findall(r"[^\W_]+", parted.casefold()))


def _truth(told: object, key: str) -> bool:
    word = str(told).strip().casefold()
    if word not in (*_TRUE, *_FALSE):
        raise MissionFileError(f"property {key}: {quote(told)}; expected true or false")
    return word in _TRUE


def _shown(texts: Iterable[str]) -> str:
    return ", ".join(quote(text) for text in texts if text)


def _open(ring: Ring) -> tuple[LatLon, ...]:
    """Return the corners of a ring without the last one where that is the first again."""
    return tuple(ring[:-1] if ring[:1] == ring[-1:] else ring)


def _joined(parts: list[tuple[Ring, Sequence[Ring]]]) -> list[tuple[Ring, Sequence[Ring]]]:
    """Return the union of `parts`, each an outline and its holes, also across the date line."""
    if len(parts) == 1:
        return parts
    import shapely

    check_outlines([Polygon(_open(r), True) for outline, holes in parts for r in (outline, *holes)])
    first = parts[0][0][0][1]

    def flat(ring: Ring) -> list[tuple[float, float]]:
        return [(latitude, first + _turn(longitude - first)) for latitude, longitude in ring]

    shapes = []
    for outline, holes in parts:
        shapes.append(shapely.Polygon(flat(outline), [flat(hole) for hole in holes]))
        if not shapely.is_valid(shapes[-1]):
            raise MissionFileError("a part crosses or touches itself; put its corners in order")
    union = shapely.get_parts(shapely.union_all(shapes))

    def places(ring: shapely.LinearRing) -> Ring:
        return [(latitude, _turn(longitude)) for latitude, longitude in ring.coords]

    return [(places(each.exterior), [places(hole) for hole in each.interiors]) for each in union]


def _turn(degrees: float) -> float:
    """Return an angle as one of -180 to 180 degrees."""
    return degrees if abs(degrees) <= 180 else (degrees + 180) % 360 - 180


def fence_of(zones: Iterable[DrawnZone]) -> Fence:
    """Return the fence of `zones`; its notes name the polygons without corners, passed over.

    Raises what `DrawnZone.polygons` raises.
    """
    polygons: list[Polygon] = []
    notes = []
    for zone in zones:
        parts = [part for part in zone.parts if part and part[0]]
        if len(parts) < len(zone.parts):
            name = f" {quote(zone.name)}" if zone.name else ""
            notes.append(f"{zone.place}{name}: a polygon without corners, passed over")
        if parts:
            polygons += replace(zone, parts=parts).polygons()
    return Fence(tuple(polygons), notes=tuple(notes))
