"""Input files read within limits; files written whole or not at all."""

import contextlib
import io
import os
import stat
import struct
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, BinaryIO

from faao_mav.errors import InputError, quote

if TYPE_CHECKING:
    import numpy as np

_SHOWN = 40
"""Characters of a file's name that its temporary file's name repeats: file systems allow 255."""

_NO_FILE = "is a device or a pipe; give the name of a file"


STANDARD_INPUT = "-"
"""The name that stands for what is piped in."""


@contextlib.contextmanager
def opened(path: str | Path, error: type[InputError] = InputError) -> Iterator[BinaryIO]:
    """Open the file `path`, or standard input, for reading.

    Raises `error` if it cannot be opened or read, or is no regular file: a pipe may never end.
    """
    try:
        if str(path) == STANDARD_INPUT:
            yield sys.stdin.buffer
            return
        kind = Path(path).stat().st_mode
        if not (stat.S_ISREG(kind) or stat.S_ISDIR(kind)):
            raise error(f"{path}: {_NO_FILE}")
        with Path(path).open("rb") as file:
            yield file
    except (OSError, ValueError) as failure:  # ValueError: a NUL in the name
        reason = getattr(failure, "strerror", None) or failure
        raise error(f"{path}: cannot be read: {reason}") from failure


def read_bytes(
    path: str | Path, most: int, what: str, error: type[InputError] = InputError
) -> bytes:
    """Return the content of the file `path`, or of standard input.

    Raises `error` as `opened` does, and for more than `most` bytes; `what` says what was expected.
    """
    with opened(path, error) as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise error(f"{path}: more than {most:,} bytes; expected {what}")
    return content


def read_text(path: str | Path, most: int, what: str, error: type[InputError]) -> str:
    """Return the UTF-8 text in the file `path`; raise `error` as `read_bytes` does and for others.

    A byte order mark is left out.
    """
    content = read_bytes(path, most, what, error)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as failure:
        before, rest = failure.object[: failure.start], failure.object[failure.start :]
        line = before.count(b"\n") + 1
        raise error(
            f"{path}: line {line}: byte 0x{rest[0]:02x} is not UTF-8; expected a text file"
        ) from failure


def read_columns(
    text: str, choices: Sequence[tuple[str, ...]], more: Sequence[str] = ()
) -> tuple[list[int], dict[str, list[float]]]:
    r"""Return the line number of each row of a table (CSV), and its columns of numbers by name.

    These are the columns of that one of `choices` that its header has.
    Those of `more` that there are come too; others, and lines that begin with #, are passed over.
    Raises `InputError` that names the line for a header without one of the `choices`, or with
    several, and for what is no number.

    >>> read_columns("time_s,east_m\n0,5\n", [("time_s", "east_m")])
    ([2], {'time_s': [0.0], 'east_m': [5.0]})
    """
    rows = [
        (number, [cell.strip().strip('"').strip() for cell in line.split(",")])
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.startswith("#")
    ]
    number, header = rows[0] if rows else (1, [])
    names = [name.lower() for name in header]
    held = [choice for choice in choices if set(choice) <= set(names)]
    if len(held) != 1:
        wanted = ", or ".join(f"{', '.join(choice[:-1])} and {choice[-1]}" for choice in choices)
        raise InputError(
            f"line {number}: columns {quote(', '.join(names))}; give a header with {wanted}"
        )
    at = {name: names.index(name) for name in (*held[0], *more) if name in names}
    found: dict[str, list[float]] = {name: [] for name in at}
    for number, cells in rows[1:]:
        for name, column in at.items():
            cell = cells[column] if column < len(cells) else ""
            try:
                found[name].append(float(cell))
            except ValueError:
                raise InputError(f"line {number}: {name}: {quote(cell)} is no number") from None
    return [number for number, _ in rows[1:]], found


MAX_BYTES = 400_000_000
"""Bytes of an archive's arrays that are read; chosen: 1,500,000 channels of two 2 x 2 links."""

_MAX_DIRECTORY = 100_000
"""Bytes of the archive's directory; chosen: 1,500 arrays, where a solution has 24."""

_END = struct.Struct("<4s8xL6x")
"""The record at the end of an archive without a comment: signature, size of the directory."""

_LARGE = 20
"""Bytes of the record before it in an archive of more than 4 GB, which begins with `PK 6 7`."""


def read_archive(
    path: str | Path, names: Sequence[str], what: str
) -> dict[str, "np.ndarray[Any, Any]"]:
    """Return those of the arrays `names` that the NumPy archive (.npz) `path` has.

    Raises `InputError` if it is no archive, if an array is none of numbers or text, and for more
    than `MAX_BYTES`; `what` says what was expected.
    """
    with opened(path) as file:
        try:
            return unpacked(file, names)
        except OSError:  # `opened` tells it
            raise
        except InputError as error:
            raise InputError(f"{path}: {error}; expected {what}") from None
        except Exception as error:  # zipfile and NumPy raise a dozen kinds for what is broken
            raise InputError(f"{path}: not {what}") from error


def unpacked(file: BinaryIO, names: Sequence[str]) -> dict[str, "np.ndarray[Any, Any]"]:
    """Return those of the arrays `names` that the archive in `file` has.

    Nothing in it is run, and nothing that it declares is believed before the bytes are there.
    Raises `InputError` for too many bytes, and an exception of any kind for anything else.
    """
    import zipfile

    from numpy.lib.format import read_array

    file.seek(max(0, file.seek(0, io.SEEK_END) - _END.size - _LARGE))
    large, end = file.read(_LARGE), file.read()
    signature, size = _END.unpack(end)
    if signature != b"PK\5\6" or size > _MAX_DIRECTORY or large.startswith(b"PK\6\7"):
        raise ValueError("no archive of a few arrays, whose directory is read in a moment")
    arrays, left = {}, MAX_BYTES
    with zipfile.ZipFile(file) as archive:
        for name in {f"{each}.npy" for each in names}.intersection(archive.namelist()):
            left -= archive.getinfo(name).file_size  # no more is unpacked of it
            if left < 0:
                raise InputError(f"more than {MAX_BYTES:,} bytes")
            with archive.open(name) as member:
                array = read_array(member, allow_pickle=False)
                if array.dtype.kind == "U":  # NumPy does not look at its characters
                    little = array.astype(array.dtype.newbyteorder("<"))
                    little.tobytes().decode("utf-32-le")
                arrays[name.removesuffix(".npy")] = array
    return arrays


def check_writable(path: str | Path) -> None:
    """Raise `InputError` when `path` plainly cannot be written: better now than after the work."""
    target, kind = Path(os.path.realpath(path)), stat.S_IFREG
    with _writing(path), contextlib.suppress(FileNotFoundError):
        kind = target.stat().st_mode
    if stat.S_ISDIR(kind):
        raise InputError(f"{path}: is a directory; give the name of a file")
    if not stat.S_ISREG(kind):  # a file would take the place of the device
        raise InputError(f"{path}: {_NO_FILE}")
    if not target.parent.is_dir():
        raise InputError(f"{path}: there is no directory {Path(path).parent}")
    if not os.access(target.parent, os.W_OK):
        raise InputError(f"{path}: the directory {target.parent} cannot be written to")
    if target.exists() and not os.access(target, os.W_OK):
        raise InputError(f"{path}: is write-protected; give another name")


PAGES = (".html", ".htm")
"""What the name of a page may end in."""

FIGURES = (".png", ".svg", ".pdf")
"""What the name of a figure may end in."""


def check_ending(path: Path, option: str, endings: Sequence[str] | None) -> None:
    """Raise `InputError` where `option` has a `path` that ends in none of `endings`."""
    if endings is not None and path.suffix not in endings:
        raise InputError(f"{option} {path}: give a name that ends in {', '.join(endings)}")


def check_apart(outputs: Mapping[str, Path | None], inputs: Mapping[str, Path | None]) -> None:
    """Raise `InputError` where one file would be written over another of the same command.

    Both are named as the user names them, an option or an argument; None stands for no file.
    """
    taken = {os.path.realpath(path): name for name, path in inputs.items() if path is not None}
    for name, path in outputs.items():
        if path is None:
            continue
        for other, owner in taken.items():
            same = other == os.path.realpath(path)
            if same or (path.exists() and Path(other).exists() and path.samefile(other)):
                raise InputError(f"{name} {path}: is the file of {owner} too; give another name")
        taken[os.path.realpath(path)] = name


def write_whole(path: str | Path, content: bytes) -> None:
    """Write `content` to `path` by way of a temporary file beside it.

    A reader sees the old file or the new one, never a part; a symbolic link stays one. Raises
    `InputError`.
    """
    write_together({path: content})


def write_together(contents: Mapping[str | Path, bytes]) -> None:
    """Write each content to its path, as `write_whole` does: all of them or none.

    None takes the place of an older file before all are on the disk. Raises `InputError`.
    """
    staged: list[tuple[Path, Path]] = []
    with contextlib.ExitStack() as cleaning:
        for path, content in contents.items():
            target = Path(os.path.realpath(path))
            with _writing(path):
                beside = f".{target.name[:_SHOWN]}."
                handle, name = tempfile.mkstemp(prefix=beside, dir=target.parent)
                cleaning.callback(Path(name).unlink, missing_ok=True)
                with os.fdopen(handle, "wb") as file:
                    file.write(content)
                    file.flush()
                    os.fsync(file.fileno())
                Path(name).chmod(0o666 & ~_umask())
            staged.append((Path(name), target))
        for path, (temporary, target) in zip(contents, staged, strict=True):
            with _writing(path):
                temporary.replace(target)


@contextlib.contextmanager
def _writing(path: str | Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


@cache
def table(name: str) -> tuple[Mapping[str, str], ...]:
    """Return the rows of the table `name` of this package by their columns; "-" is nothing.

    >>> table("autopilot/failsafes.tsv")[0]["loss"]
    'RC lost'
    """
    text = (Path(__file__).parent / name).read_text(encoding="utf-8")
    head, *rows = (line.split("\t") for line in text.splitlines())
    return tuple(
        {key: "" if each == "-" else each for key, each in zip(head, row, strict=True)}
        for row in rows
    )


class Numbers(SimpleNamespace):
    """Numbers, by their names."""

    if TYPE_CHECKING:

        def __getattribute__(self, name: str, /) -> float: ...


def numbers(name: str, **those: str) -> Numbers:
    """Return the numbers of the table `name`, "value" by "name", with `those` in other columns.

    >>> numbers("autopilot/constants.tsv", model="px4").cut
    1.0
    """
    rows = (row for row in table(name) if those.items() <= row.items())
    return Numbers(**{row["name"]: float(row["value"]) for row in rows})
