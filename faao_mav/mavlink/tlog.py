"""Logs of an exchange, as MAVProxy and Mission Planner write and read them."""

import struct
import time
from collections.abc import Callable
from pathlib import Path

from faao_mav.errors import InputError
from faao_mav.files import check_writable


class Tlog:
    """A `.tlog` file: before each packet the time since 1970, 8 bytes, big-endian, microseconds.

    Raises `InputError` if the file cannot be written, or by its name is none of these: a slip of
    the pen must not replace the mission.
    """

    def __init__(self, path: Path, clock: Callable[[], float] = time.time) -> None:
        if path.suffix != ".tlog":
            raise InputError(f"--log {path}: give a name that ends in .tlog")
        check_writable(path)
        try:
            self._file = path.open("wb")
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None
        self._clock = clock

    def write(self, packet: bytes) -> None:
        """Append `packet`, sent or received now."""
        self._file.write(struct.pack(">Q", int(self._clock() * 1e6)) + packet)

    def close(self) -> None:
        """Finish."""
        self._file.close()
