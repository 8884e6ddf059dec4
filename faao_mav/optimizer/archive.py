"""NumPy archives (.npz) that anyone may have written, read without trust.

Nothing in them is run, and nothing that they declare is believed before the bytes are there.
"""

import io
import math
import struct
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any, BinaryIO

import numpy as np

from faao_mav.errors import InputError
from faao_mav.files import opened

MAX_BYTES = 400_000_000
"""Bytes of all arrays that are read; chosen: 1,500,000 channels of two links of 2 x 2 antennas."""

_MAX_DIRECTORY = 100_000
"""Bytes of the archive's directory; chosen: 1,500 arrays, where a solution has 24."""

_PIECE = 1_000_000
"""Bytes that are unpacked at once; chosen."""

_MAX_HEADER = 70_000
"""Bytes in which the header of an .npy file has to end: that of version 1.0 has at most 65,545."""

_END = struct.Struct("<4s8xL6x")
"""The record at the end of an archive without a comment: signature, size of the directory."""

_LARGE = 20
"""Bytes of the record before it in an archive of more than 4 GB, which begins with `PK 6 7`."""


def read_archive(path: str | Path, names: Sequence[str]) -> dict[str, "np.ndarray[Any, Any]"]:
    """Return those of the arrays `names` that the archive `path` has, as they are there.

    Raises `InputError` if it is no archive, if an array is none of numbers or text, and for more
    than `MAX_BYTES`.
    """
    with opened(path) as file:
        try:
            return dict(_arrays(file, names))
        except OSError:  # `opened` tells it
            raise
        except _TooLargeError:
            raise InputError(
                f"{path}: more than {MAX_BYTES:,} bytes; expected a result of faao-mission --save"
            ) from None
        except Exception as error:  # zipfile and NumPy raise a dozen kinds for what is broken
            raise InputError(f"{path}: not a result of faao-mission --save") from error


class _TooLargeError(Exception):
    """The arrays have more than `MAX_BYTES`."""


def _arrays(file: BinaryIO, names: Sequence[str]) -> "Iterator[tuple[str, np.ndarray[Any, Any]]]":
    _check_directory(file)
    left = MAX_BYTES
    with zipfile.ZipFile(file) as archive:
        held = set(archive.namelist())
        for name in names:
            if f"{name}.npy" not in held:
                continue
            left -= (size := archive.getinfo(f"{name}.npy").file_size)  # no more is unpacked of it
            if left < 0:
                raise _TooLargeError
            with archive.open(f"{name}.npy") as member:
                yield name, _array(_unpacked(member, size))


def _check_directory(file: BinaryIO) -> None:
    """Raise ValueError for an archive whose directory is not read in a moment."""
    file.seek(max(0, file.seek(0, io.SEEK_END) - _END.size - _LARGE))
    large, end = file.read(_LARGE), file.read()
    signature, size = _END.unpack(end)
    if signature != b"PK\5\6" or size > _MAX_DIRECTORY or large.startswith(b"PK\6\7"):
        raise ValueError("no archive of a few arrays")


def _unpacked(member: IO[bytes], size: int) -> memoryview:
    """Return the `size` bytes of `member`, which are in memory once; raise EOFError for fewer."""
    content = memoryview(bytearray(size))
    at = 0
    while at < size:
        piece = member.read(min(size - at, _PIECE))
        if not piece:
            raise EOFError
        content[at : at + len(piece)] = piece
        at += len(piece)
    return content.toreadonly()


def _array(content: memoryview) -> "np.ndarray[Any, Any]":
    """Return the array in the .npy file `content`; shape and type have to fit its length."""
    stream = io.BytesIO(content[:_MAX_HEADER])
    read_header = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }[np.lib.format.read_magic(stream)]
    shape, by_columns, kind = read_header(stream)
    flat = np.frombuffer(content, kind, math.prod(shape), stream.tell())
    return flat.reshape(shape, order="F" if by_columns else "C")
