"""Fences from files: QGroundControl's `.plan`, KML, KMZ and GeoJSON."""

from pathlib import Path

from faao_mav.errors import InputError, MissionFileError
from faao_mav.files import read_bytes, read_text
from faao_mav.mission.fence import Fence

FENCE_SUFFIXES = (".plan", ".kml", ".kmz", ".geojson", ".json")
"""What the name of a file with a fence may end in."""

MAX_BYTES = 4_000_000
"""Bytes of the largest file that is read; chosen: far more than any autopilot stores."""


def read_fence(path: Path) -> Fence:
    """Return the fence in the file `path`, whose format its name's ending tells.

    Of a drawing (KML, KMZ, GeoJSON) it is the polygons, each to stay in or out of as its words
    tell: see `drawn_zones`. Raises `MissionFileError` if the ending is unknown or the file cannot
    be read, is too large, holds no fence, or leaves open what a polygon means.
    """
    suffix = path.suffix.lower()
    if suffix not in FENCE_SUFFIXES:
        shown = repr(path.suffix) if path.suffix else "no ending"
        raise MissionFileError(f"{path}: {shown}; expected a .plan, .kml, .kmz or .geojson file")
    if suffix == ".plan":
        from faao_mav.mission.formats.qgc_plan_reader import read_qgc_plan

        text = read_text(path, MAX_BYTES, "a fence", MissionFileError)
        fence = read_qgc_plan(text, str(path)).mission.fence
    else:
        fence = _drawing(path, suffix)
    if not fence:
        raise MissionFileError(f"{path}: holds no fence; expected polygons")
    return fence


def _drawing(path: Path, suffix: str) -> Fence:
    from faao_mav.mission.formats.drawn_zones import fence_of

    if suffix in (".kml", ".kmz"):
        from faao_mav.mission.formats.kml_zones import kml_zones

        zones = kml_zones(read_bytes(path, MAX_BYTES, "a fence", MissionFileError), MAX_BYTES)
    else:
        from faao_mav.mission.formats.geojson import geojson_zones

        zones = geojson_zones(read_text(path, MAX_BYTES, "a fence", MissionFileError))
    try:
        return fence_of(zones)
    except InputError as error:
        raise MissionFileError(f"{path}: {error}") from None
