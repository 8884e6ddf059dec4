"""Fences from files: QGroundControl's `.plan`, KML and GeoJSON."""

from pathlib import Path

from faao_mav.errors import MissionFileError
from faao_mav.files import read_text
from faao_mav.mission.fence import Fence

FENCE_SUFFIXES = (".plan", ".kml", ".geojson", ".json")
"""What the name of a file with a fence may end in."""

_MAX_BYTES = 4_000_000
"""Bytes of the largest file that is read; chosen: far more than any autopilot stores."""

_MAX_CORNERS = 2_000
"""Corners of the largest fence that is read; chosen: autopilots store some hundred."""


def read_fence(path: Path) -> Fence:
    """Return the fence in the file `path`, whose format its name's ending tells.

    Of KML and GeoJSON it is the polygons: those to stay in unless they, or what they are in, say
    otherwise; their holes are exclusions. Raises `MissionFileError` if the ending is unknown or
    the file cannot be read, is too large or holds no fence.
    """
    suffix = path.suffix.lower()
    if suffix not in FENCE_SUFFIXES:
        shown = repr(path.suffix) if path.suffix else "no ending"
        raise MissionFileError(f"{path}: {shown}; expected a .plan, .kml or .geojson file")
    text = read_text(path, _MAX_BYTES, "a fence", MissionFileError)
    if suffix == ".plan":
        from faao_mav.mission.formats.qgc_plan_reader import read_qgc_plan

        fence = read_qgc_plan(text, str(path)).mission.fence
    elif suffix == ".kml":
        from faao_mav.mission.formats.kml_fence import read_kml_fence

        fence = read_kml_fence(text, str(path))
    else:
        from faao_mav.mission.formats.geojson import read_geojson_fence

        fence = read_geojson_fence(text, str(path))
    if not fence:
        raise MissionFileError(f"{path}: holds no fence; expected polygons")
    corners = sum(len(polygon.vertices) for polygon in fence.polygons) + len(fence.circles)
    if corners > _MAX_CORNERS:
        raise MissionFileError(
            f"{path}: {corners:,} corners; at most {_MAX_CORNERS:,} are accepted: simplify it"
        )
    return fence
