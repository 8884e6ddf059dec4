"""Text files read; files written whole or not at all."""

import contextlib
import os
import tempfile
from pathlib import Path

from faao_mav.errors import InputError


def read_text(path: str | Path, most: int, what: str, error: type[InputError]) -> str:
    """Return the UTF-8 text in the file `path`.

    Raises `error` if it cannot be opened, is larger than `most` bytes (`what` says what was
    expected instead) or is not UTF-8.
    """
    try:
        with Path(path).open("rb") as file:
            content = file.read(most + 1)
    except (OSError, ValueError) as failure:  # ValueError: a NUL in the name
        reason = getattr(failure, "strerror", None) or failure
        raise error(f"{path}: cannot be read: {reason}") from failure
    if len(content) > most:
        raise error(f"{path}: more than {most // 1_000_000} MB; expected {what}")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as failure:
        line = content.count(b"\n", 0, failure.start) + 1
        raise error(
            f"{path}: line {line}: byte 0x{content[failure.start]:02x} is not UTF-8; "
            "expected a text file"
        ) from failure


def check_writable(path: str | Path) -> None:
    """Raise `InputError` when `path` plainly cannot be written: better now than after the work."""
    target = Path(path)
    if target.is_dir():
        raise InputError(f"{path}: is a directory; give the name of a file")
    if not target.parent.is_dir():
        raise InputError(f"{path}: there is no directory {target.parent}")
    if not os.access(target.parent, os.W_OK):
        raise InputError(f"{path}: the directory {target.parent} cannot be written to")


def write_whole(path: str | Path, content: bytes) -> None:
    """Write `content` to `path` by way of a temporary file beside it.

    A reader sees the old file or the new one, never a part. Raises `InputError`.
    """
    target = Path(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            Path(name).chmod(0o666 & ~_umask())
            Path(name).replace(target)
        except BaseException:
            with contextlib.suppress(FileNotFoundError):
                Path(name).unlink()
            raise
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
