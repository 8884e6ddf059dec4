"""What of a plan's text is on the map: stations, ends and zones, and what dragging them writes."""

import math
from collections.abc import Iterator
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
"""Path and name of what stands on the map, by its kind."""

_METRES, _DEGREES = 2, 8
"""Decimals that dragging writes: 1 cm, and 1 mm in degrees. Chosen."""


class Scene:
    """The places in a document that may not be a sound plan; those that are no places are left out.

    `frame` is None where the document has no sound origin: then nothing is on the map.
    """

    def __init__(self, document: Document) -> None:
        self._document = document
        origin = document.value(("site", "origin"))
        self.frame: LocalFrame | None = None
        try:
            self.frame = LocalFrame(float(origin["latitude"]), float(origin["longitude"]))
        except (FaaoError, TypeError, KeyError, ValueError):
            return

    def stations(self) -> list[dict[str, Any]]:
        """Return kind, name, key and [latitude, longitude] of stations and ends."""
        places = ((kind, name, self.degrees(self._document.value(path)))
                  for kind, (path, name) in STATIONS.items())  # fmt: skip
        return [
            {"key": kind, "kind": kind, "label": name, "at": at} for kind, name, at in places if at
        ]

    def zones(self) -> list[dict[str, Any]]:
        """Return the zones of the fence: key, inclusion, and corners or center and radius."""
        found = []
        for path, inclusion, value in self._listed():
            zone = {"key": "/".join(map(str, path)), "inclusion": inclusion}
            held = value if isinstance(value, dict) else {"polygon": value}
            if "polygon" in held:
                ring = held["polygon"] if isinstance(held["polygon"], list) else []
                corners = [self.degrees(each) for each in ring]
                if len(corners) > 2 and all(corners):
                    found.append(zone | {"corners": corners})
                continue
            at, radius = self.degrees(held.get("center")), held.get("radius")
            if at and isinstance(radius, int | float) and 0 < radius < math.inf:
                found.append(zone | {"center": at, "radius": radius})
        return found

    def move(self, kind: str, at: list[float], gesture: object) -> None:
        """Write the place of a station or end, where there is an origin to count from."""
        if self.frame is None:
            return
        path = STATIONS[kind][0]
        self._document.put(path, self._as_before(path, at), gesture)

    def change(self, told: dict[str, Any], gesture: object) -> None:
        """Write a zone that was moved, or with the key None a new one.

        A zone that is no longer there, undone while it was dragged, stays away.
        """
        if self.frame is None or not (told["key"] is None or self._has(told["key"])):
            return
        name = "inclusion" if told["inclusion"] else "exclusion"
        value: Any
        if told.get("center"):
            value = {"center": self._metres(told["center"]), "radius": round(told["radius"], 2)}
        else:
            value = {"polygon": [self._metres(each) for each in told["corners"]]}
        path: Path = ("fence", name)
        if told["key"] is not None:
            path = _path(told["key"])
            old = self._document.value(path)
            self._document.put(path, value["polygon"] if isinstance(old, list) else value, gesture)
            return
        held = self._document.value(path)
        zones = held if isinstance(held, list) else []
        if path == ("fence", "inclusion") and zones and not self._are_zones(zones):
            zones = [{"polygon": zones}]  # the short form holds one polygon only
        if zones and zones == held:
            self._document.put((*path, len(zones)), value)
        else:
            self._document.put(path, [*zones, value])

    def remove(self, key: str) -> None:
        """Take a zone out, if it is there, and the whole fence with its last."""
        if not self._has(key):
            return
        path = _path(key)
        rest = [each for each, _, _ in self._listed() if each != path]
        if not rest and self._document.value(("fence", "file")) is None:
            path = ("fence",)
        elif not any(each[:2] == path[:2] for each in rest):
            path = path[:2]
        self._document.remove(path)

    def degrees(self, value: object) -> list[float] | None:
        """Return [latitude, longitude] of a position as a plan writes it; None if it is none."""
        try:
            if isinstance(value, dict):
                return [float(value["latitude"]), float(value["longitude"])]
            if isinstance(value, list) and self.frame is not None:
                east, north = map(float, value)
                latitude, longitude = self.frame.to_geodetic((east, north))
                found = [float(latitude), float(longitude)]
                return found if all(map(math.isfinite, found)) else None
        except (KeyError, TypeError, ValueError):
            return None
        return None

    def _as_before(self, path: Path, at: list[float]) -> object:
        """Return a place in degrees where the document has it so, else in metres."""
        if isinstance(self._document.value(path), dict):
            return dict(
                zip(("latitude", "longitude"), (round(x, _DEGREES) for x in at), strict=True)
            )
        return self._metres(at)

    def _metres(self, at: list[float]) -> list[float]:
        assert self.frame is not None
        return [round(x, _METRES) + 0.0 for x in self.frame.to_local(*at).tolist()]

    def _has(self, key: str) -> bool:
        return any(path == _path(key) for path, _, _ in self._listed())

    def _listed(self) -> Iterator[tuple[Path, bool, Any]]:
        for name in ("inclusion", "exclusion"):
            value = self._document.value(("fence", name))
            if not isinstance(value, list) or not value or self.frame is None:
                continue
            if self._are_zones(value):
                for k, zone in enumerate(value):
                    yield ("fence", name, k), name == "inclusion", zone
            else:
                yield ("fence", name), name == "inclusion", value

    @staticmethod
    def _are_zones(value: list[Any]) -> bool:
        return any(isinstance(each, dict) and "latitude" not in each for each in value)


def _path(key: str) -> Path:
    return tuple(int(step) if step.isdigit() else step for step in key.split("/"))
