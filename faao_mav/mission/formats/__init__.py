"""Mission files, by the ending of their name."""

from pathlib import Path

from faao_mav.errors import MissionFileError
from faao_mav.mission.formats.wpl import read_wpl, write_wpl
from faao_mav.mission.item import Mission

__all__ = [
    "MISSION_SUFFIXES",
    "check_suffix",
    "read_mission",
    "read_wpl",
    "render_mission",
    "write_wpl",
]

MISSION_SUFFIXES = (".waypoints", ".txt")
"""What the name of a mission file may end in."""

MAX_BYTES = 16_000_000
"""More than any autopilot stores; keeps a wrong file name from filling the memory."""


def read_mission(path: str | Path) -> Mission:
    """Return the mission in the file `path`, whose format its name's ending tells.

    Raises `MissionFileError` if the ending is unknown, or the file cannot be opened, is not
    UTF-8 text, is larger than `MAX_BYTES` or is not a mission.
    """
    path = Path(path)
    check_suffix(path)
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or error
        raise MissionFileError(f"{path}: cannot be read: {reason}") from error
    if len(content) > MAX_BYTES:
        raise MissionFileError(f"{path}: more than {MAX_BYTES // 1_000_000} MB; expected a mission")
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise MissionFileError(
            f"{path}: line {line}: byte 0x{content[error.start]:02x} is not UTF-8; "
            "expected a text file"
        ) from error
    return read_wpl(text, str(path))


def render_mission(mission: Mission, path: str | Path) -> str:
    """Return the text to write to the file `path`, in the format that its name's ending tells.

    Raises `MissionFileError` if the ending is unknown.
    """
    check_suffix(Path(path))
    return write_wpl(mission)


def check_suffix(path: Path) -> None:
    """Raise `MissionFileError` unless the name of `path` ends like a format that is known."""
    if path.suffix.lower() not in MISSION_SUFFIXES:
        shown = repr(path.suffix) if path.suffix else "no ending"
        raise MissionFileError(
            f"{path}: {shown}; expected a name that ends in {' or '.join(MISSION_SUFFIXES)} "
            "(.plan and .kml are not written yet)"
        )
