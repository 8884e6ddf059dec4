"""Fences from files: QGroundControl's `.plan`, KML, KMZ and GeoJSON."""

from pathlib import Path

from faao_mav.errors import MissionFileError
from faao_mav.files import read_bytes, read_text
from faao_mav.mission.fence import Fence
from faao_mav.mission.formats import naming, read_mission

MAX_BYTES = 4_000_000
"""Bytes of the largest file that is read; chosen: far more than any autopilot stores."""


def read_fence(path: Path) -> Fence:
    """Return the fence in the file `path`, whose format its name's ending tells.

    Of a drawing (KML, KMZ, GeoJSON) it is the polygons, each to stay in or out of as its words
    tell: see `drawn_zones`. Raises `MissionFileError` if the ending is unknown or the file cannot
    be read, is too large, holds no fence, or leaves open what a polygon means.
    """
    from faao_mav.mission.formats.drawn_zones import fence_of
    from faao_mav.mission.formats.geojson import geojson_zones
    from faao_mav.mission.formats.kml_zones import kml_zones

    match path.suffix.lower():
        case ".plan":
            fence = read_mission(path).fence
        case ".kml" | ".kmz":
            content = read_bytes(path, MAX_BYTES, "a fence", MissionFileError)
            fence = naming(path, lambda: fence_of(kml_zones(content, MAX_BYTES)))
        case ".geojson" | ".json":
            text = read_text(path, MAX_BYTES, "a fence", MissionFileError)
            fence = naming(path, lambda: fence_of(geojson_zones(text)))
        case suffix:
            shown = repr(suffix) if suffix else "no ending"
            raise MissionFileError(
                f"{path}: {shown}; expected a .plan, .kml, .kmz or .geojson file"
            )
    if not fence:
        raise MissionFileError(f"{path}: holds no fence; expected polygons")
    return fence
