"""Mission files, by the ending of their name, and the files beside them that belong to them.

Whoever takes a mission takes the fence and the parameters beside it too. So those that a run of
this program wrote say so in a comment, and go when the mission is another one; those of other
origin are not touched.
"""

import errno
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias, TypeVar

from faao_mav.errors import InputError, MissionFileError
from faao_mav.files import check_writable, read_text, write_together
from faao_mav.mission.formats.kml import kml_losses, write_kml
from faao_mav.mission.formats.mission_file import MissionFile as MissionFile
from faao_mav.mission.formats.mission_file import PlanTarget as PlanTarget
from faao_mav.mission.formats.qgc_plan import plan_losses, read_qgc_plan
from faao_mav.mission.formats.qgc_plan import write_qgc_plan as write_qgc_plan
from faao_mav.mission.formats.wpl import read_wpl, read_wpl_fence, wpl_losses, write_wpl_fence
from faao_mav.mission.formats.wpl import write_wpl as write_wpl
from faao_mav.mission.item import Mission, fence_items

Target: TypeAlias = PlanTarget | None
Read = TypeVar("Read")


@dataclass(frozen=True, slots=True)
class Format:
    """How missions of one format are read and written.

    `read(text)` is None for a format that only draws a mission. `write(mission, target, name)`
    returns the text of a file with that name, and raises `MissionFileError` for a mission that the
    format cannot hold at all; `losses(mission, target)` says what it leaves out, one line each.
    `fence_beside`: the fence is a file of its own beside the mission's. Another format is one file
    beside this one and one entry of `_FORMATS`.
    """

    read: Callable[[str], MissionFile] | None
    write: Callable[[Mission, Target, str], str]
    losses: Callable[[Mission, Target], Iterable[str]]
    fence_beside: bool = False


_WPL = Format(read_wpl, lambda mission, *_: write_wpl(mission), wpl_losses, True)
_FORMATS = {
    ".waypoints": _WPL,
    ".txt": _WPL,
    ".plan": Format(read_qgc_plan, lambda mission, to, _: write_qgc_plan(mission, to), plan_losses),
    ".kml": Format(None, lambda mission, _, name: write_kml(mission, name), kml_losses),
}

MAX_BYTES = 16_000_000
"""Bytes of the largest file that is read; chosen: far more than any autopilot stores."""


@dataclass(frozen=True, slots=True)
class Rendered:
    """The files of a mission: their contents, and what of it they do not hold, one line each."""

    contents: dict[str | Path, bytes]
    lost: tuple[str, ...]


def read_mission(path: str | Path) -> Mission:
    """Return the mission in the file `path`, with the fence beside it.

    The file's format is told by the ending of its name. Raises `MissionFileError` as
    `read_mission_file`.

    >>> mission = read_mission("tests/data/missions/plain.waypoints")
    >>> [item.command for item in mission.items]
    [22, 178, 16, 177, 20]
    """
    return read_mission_file(path).mission


def read_mission_file(path: str | Path) -> MissionFile:
    """Return what the file `path` tells, whose format its name's ending tells.

    A format that holds no fence has it in the file `fence_path`, if that is there. The warnings
    name their file. Raises `MissionFileError` if the ending is unknown or that of a format for
    drawing only, or a file cannot be opened, is not UTF-8 text, is larger than `MAX_BYTES` or is
    not what it should be.
    """
    path = Path(path)
    read = check_suffix(path).read
    if read is None:
        raise MissionFileError(
            f"{path}: KML is written for drawing and lacks commands and speeds; "
            "give the .waypoints or .plan file of the mission"
        )
    file, beside = _read(path, "a mission", read), fence_path(path)
    mission, warnings = file.mission, [f"{path}: {line}" for line in file.warnings]
    if beside is not None and beside.is_file():
        mission = replace(mission, fence=_read(beside, "a fence", read_wpl_fence))
        warnings.append(f"{beside}: the fence beside {path.name}, taken with it")
    return replace(file, mission=mission, warnings=tuple(warnings))


def _read(path: Path, what: str, read: Callable[[str], Read]) -> Read:
    text = read_text(path, MAX_BYTES, what, MissionFileError)
    return naming(path, lambda: read(text))


def naming(path: Path, work: Callable[[], Read]) -> Read:
    """Return what `work` returns; an `InputError` of it becomes one that names the file `path`."""
    try:
        return work()
    except InputError as error:
        raise MissionFileError(f"{path}: {error}") from None
    except RecursionError:
        raise MissionFileError(f"{path}: nested too deep for a plan or a fence") from None


def fence_path(mission: Path) -> Path | None:
    """Return the file of the fence beside `mission`; None for a format that holds it, or no fence.

    >>> fence_path(Path("flight.waypoints")).name
    'flight.fence.waypoints'
    """
    if not check_suffix(mission).fence_beside:
        return None
    return mission.with_name(f"{mission.stem}.fence{mission.suffix}")


def render_files(mission: Mission, path: str | Path, target: Target = None) -> Rendered:
    """Return what is to be written: the file `path`, and the fence beside it if it has to be.

    The ending of the name tells the format. `target` is whom a `.plan` is for, which says so and
    holds what that autopilot takes. Raises `MissionFileError` if the ending is unknown or the
    format cannot hold the mission at all.

    >>> render_files(Mission(()), "flight.waypoints").lost
    ('no home is known: the file says 0, 0, 0, which means none',)
    """
    path = Path(path)
    found = check_suffix(path)
    text = naming(path, lambda: found.write(mission, target, path.stem))
    contents: dict[str | Path, bytes] = {path: text.encode()}
    beside = fence_path(path)
    if beside is not None and fence_items(mission.fence):
        # the name of a mission may be no Unicode
        contents[beside] = write_wpl_fence(mission, comment_for(path)).encode(errors="replace")
    return Rendered(contents, tuple(found.losses(mission, target)))


def write_mission(mission: Mission, path: Path, target: Target = None) -> Rendered:
    """Write the files of `render_files`, all or none, and return them.

    The fence of an earlier mission beside `path` is removed; one of other origin is not replaced.
    Raises `InputError`.
    """
    rendered, beside = render_files(mission, path, target), fence_path(path)
    if beside is not None and beside in rendered.contents:
        check_replaceable(beside, "the mission's fence is")
    write_together(rendered.contents)
    if beside is not None and beside not in rendered.contents:
        remove_outdated(beside)
    return rendered


def render_mission(mission: Mission, path: str | Path, target: Target = None) -> str:
    """Return the text of the file `path` of `render_files`, without the fence beside it.

    >>> render_mission(Mission(()), "flight.waypoints").splitlines()[0]
    'QGC WPL 110'
    """
    return render_files(mission, path, target).contents[Path(path)].decode()


def check_suffix(path: Path) -> Format:
    """Return the format by the ending of the name; raise `MissionFileError` for an unknown one."""
    if path.suffix.lower() not in _FORMATS:
        shown = repr(path.suffix) if path.suffix else "no ending"
        raise MissionFileError(
            f"{path}: {shown}; expected a name that ends in .waypoints or .txt (QGC WPL 110), "
            ".plan (QGroundControl) or .kml (Google Earth, write only)"
        )
    return _FORMATS[path.suffix.lower()]


def comment_for(mission: Path) -> str:
    """Return what a file that is written beside `mission` says in its first comment."""
    return f"for {mission.name}"


def check_replaceable(beside: Path, what: str) -> None:
    """Raise `InputError` where `what`, to be written to `beside`, would replace a user's own file.

    Likewise for a file that cannot be written. To be asked before the work.
    """
    check_writable(beside)
    if beside.exists() and not _is_of_a_run(beside):
        raise InputError(
            f"{beside}: {what} to go there, but it is not of an earlier run; rename it, or give "
            "the mission another name"
        )


def remove_outdated(beside: Path) -> None:
    """Remove `beside` if an earlier run wrote it: it belongs to a mission that is gone."""
    try:
        if _is_of_a_run(beside):
            beside.unlink()
    except OSError as error:
        if error.errno != errno.ENAMETOOLONG:  # nothing can be there
            told = f"is of an earlier mission and cannot be removed: {error.strerror}"
            raise InputError(f"{beside}: {told}") from None


def _is_of_a_run(beside: Path) -> bool:
    """Tell by the first two lines, as `comment_for` has it, whether this program wrote `beside`."""
    if not beside.is_file():
        return False
    with beside.open("rb") as file:
        lines = [file.readline(300).strip().lower() for _ in range(2)]
    missions = tuple(map(str.encode, _FORMATS))
    return any(each.startswith(b"# for ") and each.endswith(missions) for each in lines)
