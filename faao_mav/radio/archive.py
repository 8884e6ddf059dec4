"""NumPy archives (.npz) that anyone may have written, read without trust.

Nothing in them is run, and nothing that they declare is believed before the bytes are there.
"""

import io
import struct
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from faao_mav.errors import InputError
from faao_mav.files import opened

MAX_BYTES = 400_000_000
"""Bytes of all arrays that are read; chosen: 1,500,000 channels of two links of 2 x 2 antennas."""

_MAX_DIRECTORY = 100_000
"""Bytes of the archive's directory; chosen: 1,500 arrays, where a solution has 24."""

_END = struct.Struct("<4s8xL6x")
"""The record at the end of an archive without a comment: signature, size of the directory."""

_LARGE = 20
"""Bytes of the record before it in an archive of more than 4 GB, which begins with `PK 6 7`."""


def read_archive(
    path: str | Path, names: Sequence[str], what: str = "a result of faao-mission --save"
) -> dict[str, "np.ndarray[Any, Any]"]:
    """Return those of the arrays `names` that the archive `path` has, as they are there.

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

    Raises `InputError` for too many bytes, and an exception of any kind for anything else.
    """
    arrays, left = {}, MAX_BYTES
    _check_directory(file)
    with zipfile.ZipFile(file) as archive:
        for name in {f"{each}.npy" for each in names}.intersection(archive.namelist()):
            left -= archive.getinfo(name).file_size  # no more is unpacked of it
            if left < 0:
                raise InputError(f"more than {MAX_BYTES:,} bytes")
            with archive.open(name) as member:
                array = np.lib.format.read_array(member, allow_pickle=False)
                if array.dtype.kind == "U":  # NumPy does not look at its characters
                    little = array.astype(array.dtype.newbyteorder("<"))
                    little.tobytes().decode("utf-32-le")
                arrays[name.removesuffix(".npy")] = array
    return arrays


def _check_directory(file: BinaryIO) -> None:
    """Raise ValueError for an archive whose directory is not read in a moment."""
    file.seek(max(0, file.seek(0, io.SEEK_END) - _END.size - _LARGE))
    large, end = file.read(_LARGE), file.read()
    signature, size = _END.unpack(end)
    if signature != b"PK\5\6" or size > _MAX_DIRECTORY or large.startswith(b"PK\6\7"):
        raise ValueError("no archive of a few arrays")
