"""What of a plan's text is on the map: stations, ends and zones, and what dragging them writes."""

import math
from contextlib import suppress
from typing import Any

from faao_mav.app.document import Document, Path
from faao_mav.errors import FaaoError
from faao_mav.geodesy import LocalFrame

STATIONS: dict[str, tuple[Path, str]] = {
    "base": (("radio", "base_station", "position"), "Base station"),
    "user": (("radio", "ground_user", "position"), "User"),
    "start": (("flight", "start"), "Start"),
    "end": (("flight", "end"), "End"),
}
"""Path and name of what stands on the map, by its key."""

_ZONES = ("inclusion", "exclusion")
"""The lists of a fence. The key of a zone is the name of its list and its number there."""

_METRES, _DEGREES = 2, 8  # decimals that dragging writes: 1 cm, and 1 mm in degrees. Chosen


class Scene:
    """The places in a document that may not be a sound plan; those that are no places are left out.

    `frame` is None where the document has no sound origin: then nothing can be moved.
    """

    def __init__(self, document: Document) -> None:
        self._document = document
        origin = document.value(("site", "origin"))
        self.frame: LocalFrame | None = None
        with suppress(FaaoError, TypeError, KeyError, ValueError):
            self.frame = LocalFrame(float(origin["latitude"]), float(origin["longitude"]))

    def stations(self) -> list[dict[str, Any]]:
        """Return key, name and [latitude, longitude] of stations and ends."""
        return [
            {"key": key, "label": name, "at": at}
            for key, (path, name) in STATIONS.items()
            if (at := self._degrees(self._document.value(path)))
        ]

    def zones(self) -> list[dict[str, Any]]:
        """Return the zones of the fence: key, inclusion, and corners or center and radius."""
        found = []
        for name in _ZONES:
            for k, value in enumerate(self._zones(name)):
                held = value if isinstance(value, dict) else {}
                zone = {"key": f"{name}/{k}", "inclusion": name == "inclusion"}
                ring, at = held.get("polygon"), self._degrees(held.get("center"))
                corners = [self._degrees(each) for each in ring] if isinstance(ring, list) else []
                radius = held.get("radius")
                if len(corners) > 2 and all(corners):
                    found.append(zone | {"corners": corners})
                elif at and isinstance(radius, int | float) and 0 < radius < math.inf:
                    found.append(zone | {"center": at, "radius": radius})
        return found

    def move(self, key: str, at: list[float], gesture: object) -> None:
        """Write the place of a station or end: in degrees where it is so already, else in metres.

        Nothing is written where there is no origin to count from.
        """
        path, _ = STATIONS[key]
        if self.frame is None:
            return
        place: object = self._metres(at)
        if isinstance(self._document.value(path), dict):
            latitude, longitude = (round(x, _DEGREES) for x in at)
            place = {"latitude": latitude, "longitude": longitude}
        self._document.put(path, place, gesture)

    def change(self, told: dict[str, Any], gesture: object) -> None:
        """Write a zone that was moved, or with the key None a new one.

        A zone that is no longer there, undone while it was dragged, stays away.
        """
        name = "inclusion" if told["inclusion"] else "exclusion"
        path, zones = ("fence", name), self._zones(name)
        k = len(zones) if told["key"] is None else self._number(told["key"])
        if self.frame is None or k is None:
            return
        value: dict[str, Any]
        if told.get("center"):
            value = {"center": self._metres(told["center"]), "radius": round(told["radius"], 2)}
        else:
            value = {"polygon": [self._metres(each) for each in told["corners"]]}
        if zones and zones == self._document.value(path):
            self._document.put((*path, k), value, gesture)
        else:  # the short form, which holds one polygon only, becomes a list
            self._document.put(path, [*zones[:k], value, *zones[k + 1 :]], gesture)

    def remove(self, key: str) -> None:
        """Take a zone out, if it is there, and the whole fence with its last."""
        if (k := self._number(key)) is None:
            return
        name = key.partition("/")[0]
        path: Path = ("fence", name, k)
        if len(self._zones(name)) == 1:
            last = sum(len(self._zones(each)) for each in _ZONES) == 1
            path = path[:1] if last and not self._document.value(("fence", "file")) else path[:2]
        self._document.remove(path)

    def _zones(self, name: str) -> list[Any]:
        """Return the zones of a list, whose short form is the corners of the only one."""
        value = self._document.value(("fence", name))
        if not isinstance(value, list) or not value:
            return []
        listed = any(isinstance(each, dict) and "latitude" not in each for each in value)
        return value if listed else [{"polygon": value}]

    def _number(self, key: str) -> int | None:
        """Return the number of the zone in its list; None where it is no longer there."""
        name, _, k = key.partition("/")
        return int(k) if int(k) < len(self._zones(name)) else None

    def _degrees(self, value: object) -> list[float] | None:
        """Return [latitude, longitude] of a position as a plan writes it; None if it is none."""
        with suppress(KeyError, TypeError, ValueError):
            if isinstance(value, dict):
                return [float(value["latitude"]), float(value["longitude"])]
            if isinstance(value, list) and self.frame is not None:
                east, north = map(float, value)
                found = [float(x) for x in self.frame.to_geodetic((east, north))]
                return found if all(map(math.isfinite, found)) else None
        return None

    def _metres(self, at: list[float]) -> list[float]:
        assert self.frame is not None
        return [round(x, _METRES) + 0.0 for x in self.frame.to_local(*at).tolist()]
