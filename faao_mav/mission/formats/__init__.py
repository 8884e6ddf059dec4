"""Mission files, by the ending of their name."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

from faao_mav.errors import MissionFileError
from faao_mav.files import read_text, write_together
from faao_mav.mission.fence_items import fence_items
from faao_mav.mission.formats.beside import check_replaceable, comment_for, remove_outdated
from faao_mav.mission.formats.losses import kml_losses, plan_losses, wpl_losses
from faao_mav.mission.formats.mission_file import MissionFile as MissionFile
from faao_mav.mission.formats.mission_file import PlanTarget as PlanTarget
from faao_mav.mission.formats.qgc_plan_writer import write_qgc_plan as write_qgc_plan
from faao_mav.mission.formats.wpl import read_wpl, read_wpl_fence, write_wpl_fence
from faao_mav.mission.formats.wpl import write_wpl as write_wpl
from faao_mav.mission.item import Mission

Target: TypeAlias = PlanTarget | None


@dataclass(frozen=True, slots=True)
class Format:
    """How missions of one format are read and written.

    `read(text, source)` is None for a format that only draws a mission. `write(mission, target,
    name)` returns the text of a file with that name, and raises `MissionFileError` for a mission
    that the format cannot hold at all; `losses(mission, target)` says what it leaves out, one line
    each. `fence_beside`: the fence is a file of its own beside the mission's. Another format is one
    file beside this one and one entry of `_FORMATS`.
    """

    read: Callable[[str, str], MissionFile] | None
    write: Callable[[Mission, Target, str], str]
    losses: Callable[[Mission, Target], list[str]]
    fence_beside: bool = False


def _read_plan(text: str, source: str) -> MissionFile:
    from faao_mav.mission.formats.qgc_plan_reader import read_qgc_plan  # brings pydantic along

    return read_qgc_plan(text, source)


def _write_kml(mission: Mission, name: str) -> str:
    from faao_mav.mission.formats.kml import write_kml  # brings an XML library along

    return write_kml(mission, name=name)


_WPL = Format(read_wpl, lambda mission, _, __: write_wpl(mission), wpl_losses, fence_beside=True)
_FORMATS = {
    ".waypoints": _WPL,
    ".txt": _WPL,
    ".plan": Format(_read_plan, lambda mission, to, _: write_qgc_plan(mission, to), plan_losses),
    ".kml": Format(None, lambda mission, _, name: _write_kml(mission, name), kml_losses),
}

MISSION_SUFFIXES = tuple(_FORMATS)
"""What the name of a mission file may end in."""

MAX_BYTES = 16_000_000
"""Bytes of the largest file that is read; chosen: far more than any autopilot stores."""


def read_mission(path: str | Path) -> Mission:
    """Return the mission in the file `path`: `read_mission_file` without what is said beside it."""
    return read_mission_file(path).mission


def read_mission_file(path: str | Path) -> MissionFile:
    """Return what the file `path` tells, whose format its name's ending tells.

    A format that holds no fence has it in the file `fence_path`, if that is there. Raises
    `MissionFileError` if the ending is unknown or that of a format for drawing only, or a file
    cannot be opened, is not UTF-8 text, is larger than `MAX_BYTES` or is not what it should be.
    """
    path = Path(path)
    read = check_readable(path)
    file = read(read_text(path, MAX_BYTES, "a mission", MissionFileError), str(path))
    beside = fence_path(path)
    if beside is None or not beside.is_file():
        return file
    text = read_text(beside, MAX_BYTES, "a fence", MissionFileError)
    taken = f"{beside}: the fence beside {path.name}, taken with it"
    return replace(
        file,
        mission=replace(file.mission, fence=read_wpl_fence(text, str(beside))),
        warnings=(*file.warnings, taken),
    )


def fence_path(mission: Path) -> Path | None:
    """Return the file of the fence beside `mission`; None for a format that holds it, or no fence.

    >>> fence_path(Path("flight.waypoints")).name
    'flight.fence.waypoints'
    """
    if not check_suffix(mission).fence_beside:
        return None
    return mission.with_name(f"{mission.stem}.fence{mission.suffix}")


def render_files(mission: Mission, path: Path, target: Target = None) -> dict[str | Path, bytes]:
    """Return what is to be written, by file: `path`, and the fence beside it if it has to be.

    Arguments and errors as in `render_mission`.
    """
    files: dict[str | Path, bytes] = {path: render_mission(mission, path, target).encode()}
    beside = fence_path(path)
    if beside is not None and fence_items(mission.fence):
        # the name of a mission may be no Unicode
        files[beside] = write_wpl_fence(mission, comment_for(path)).encode(errors="replace")
    return files


def write_mission(mission: Mission, path: Path, target: Target = None) -> tuple[Path, ...]:
    """Write the files of `render_files`, all or none, and return their paths.

    The fence of an earlier mission beside `path` is removed; one of other origin is not replaced.
    Raises `InputError`.
    """
    files = render_files(mission, path, target)
    beside = fence_path(path)
    if beside is not None and beside in files:
        check_replaceable(beside, "the mission's fence is")
    write_together(files)
    if beside is not None and beside not in files:
        remove_outdated(beside)
    return tuple(map(Path, files))


def render_mission(mission: Mission, path: str | Path, target: Target = None) -> str:
    """Return the text to write to the file `path`, in the format that its name's ending tells.

    `target` is whom a `.plan` is for, which says so and holds what that autopilot takes. Raises
    `MissionFileError` if the ending is unknown or the format cannot hold the mission at all. For
    the fence of a format that does not hold it see `render_files`.

    >>> render_mission(Mission(()), "flight.waypoints").splitlines()[0]
    'QGC WPL 110'
    """
    path = Path(path)
    found = check_suffix(path)
    try:
        return found.write(mission, target, path.stem)
    except MissionFileError as error:
        raise MissionFileError(f"{path}: {error}") from None


def losses_in(mission: Mission, path: str | Path, target: Target = None) -> list[str]:
    """Return what of `mission` the files of `render_files` do not hold, one line each.

    >>> losses_in(Mission(()), "flight.waypoints")
    ['no home is known: the file says 0, 0, 0, which means none']
    """
    return check_suffix(Path(path)).losses(mission, target)


def check_suffix(path: Path) -> Format:
    """Return the format by the ending of the name; raise `MissionFileError` for an unknown one."""
    if path.suffix.lower() not in _FORMATS:
        shown = repr(path.suffix) if path.suffix else "no ending"
        raise MissionFileError(
            f"{path}: {shown}; expected a name that ends in .waypoints or .txt (QGC WPL 110), "
            ".plan (QGroundControl) or .kml (Google Earth, write only)"
        )
    return _FORMATS[path.suffix.lower()]


def check_readable(path: Path) -> Callable[[str, str], MissionFile]:
    """Return the reader for a file by the ending of its name.

    Raises `MissionFileError` unless it is that of a format that can be read.
    """
    read = check_suffix(path).read
    if read is None:
        raise MissionFileError(
            f"{path}: KML is written for drawing and lacks commands and speeds; "
            "give the .waypoints or .plan file of the mission"
        )
    return read
