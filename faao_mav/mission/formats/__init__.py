"""Mission files, by the ending of their name."""

from pathlib import Path
from typing import Literal, TypeAlias

from faao_mav.errors import MissionFileError
from faao_mav.files import read_text
from faao_mav.mission.formats.losses import losses
from faao_mav.mission.formats.mission_file import MissionFile, NamedVehicle
from faao_mav.mission.formats.qgc_plan_reader import read_qgc_plan
from faao_mav.mission.formats.qgc_plan_writer import write_qgc_plan
from faao_mav.mission.formats.wpl import read_wpl, write_wpl
from faao_mav.mission.item import Mission

__all__ = [
    "MISSION_SUFFIXES",
    "MissionFile",
    "check_readable",
    "check_suffix",
    "losses_in",
    "read_mission",
    "read_mission_file",
    "read_qgc_plan",
    "read_wpl",
    "render_mission",
    "write_qgc_plan",
    "write_wpl",
]

Format: TypeAlias = Literal["wpl", "plan", "kml"]

_FORMATS: dict[str, Format] = {".waypoints": "wpl", ".txt": "wpl", ".plan": "plan", ".kml": "kml"}

MISSION_SUFFIXES = tuple(_FORMATS)
"""What the name of a mission file may end in."""

MAX_BYTES = 16_000_000
"""More than any autopilot stores; keeps a wrong file name from filling the memory."""


def read_mission(path: str | Path) -> Mission:
    """Return the mission in the file `path`: `read_mission_file` without what is said beside it."""
    return read_mission_file(path).mission


def read_mission_file(path: str | Path) -> MissionFile:
    """Return what the file `path` tells, whose format its name's ending tells.

    Raises `MissionFileError` if the ending is unknown or that of a format for drawing only, or
    the file cannot be opened, is not UTF-8 text, is larger than `MAX_BYTES` or is not a mission.
    """
    path = Path(path)
    check_readable(path)
    text = read_text(path, MAX_BYTES, "a mission", MissionFileError)
    if _format(path) == "plan":
        return read_qgc_plan(text, str(path))
    return MissionFile(read_wpl(text, str(path)))


def render_mission(mission: Mission, path: str | Path, vehicle: NamedVehicle | None = None) -> str:
    """Return the text to write to the file `path`, in the format that its name's ending tells.

    `vehicle` is whom the mission is for: `.plan` says so, and holds what it takes. Raises
    `MissionFileError` if the ending is unknown or the format cannot hold the mission at all.
    """
    path = Path(path)
    check_suffix(path)
    match _format(path):
        case "wpl":
            return write_wpl(mission)
        case "plan":
            try:
                return write_qgc_plan(mission, vehicle)
            except MissionFileError as error:
                raise MissionFileError(f"{path}: {error}") from None
        case "kml":
            from faao_mav.mission.formats.kml import write_kml  # brings an XML library along

            return write_kml(mission, name=path.stem)


def losses_in(mission: Mission, path: str | Path, vehicle: NamedVehicle | None = None) -> list[str]:
    """Return what of `mission` the text of `render_mission` does not hold, one line each."""
    path = Path(path)
    check_suffix(path)
    return losses(mission, _format(path), vehicle)


def check_suffix(path: Path) -> None:
    """Raise `MissionFileError` unless the name of `path` ends like a format that is known."""
    if path.suffix.lower() not in _FORMATS:
        shown = repr(path.suffix) if path.suffix else "no ending"
        raise MissionFileError(
            f"{path}: {shown}; expected a name that ends in .waypoints or .txt (QGC WPL 110), "
            ".plan (QGroundControl) or .kml (Google Earth, write only)"
        )


def check_readable(path: Path) -> None:
    """Raise `MissionFileError` unless the name of `path` ends like a format that can be read."""
    check_suffix(path)
    if _format(path) == "kml":
        raise MissionFileError(
            f"{path}: KML is written for drawing and lacks commands and speeds; "
            "give the .waypoints or .plan file of the mission"
        )


def _format(path: Path) -> Format:
    return _FORMATS[path.suffix.lower()]
