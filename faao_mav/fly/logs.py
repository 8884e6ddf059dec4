"""Flights from the logs of autopilots and ground stations."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryFile

from faao_mav.errors import InputError, check_extra, shortened
from faao_mav.fly import log_messages
from faao_mav.fly.log_flights import flights
from faao_mav.fly.log_messages import Said
from faao_mav.fly.record import FlightRecord

_ENDINGS = (".bin", ".tlog", ".ulg")

_LARGEST = 2**30
"""Bytes of a log that is read; chosen: hours of a `.bin`."""

_BEGINNING = 8000
"""Bytes at the beginning of a text log in which its first format stands; chosen."""

_LONGEST_REASON = 200
"""Characters that are shown of a reason why a log was not read; chosen."""

_PATIENCE = 60.0
"""Seconds after which reading a log is given up; chosen: a `.bin` of 10^9 bytes takes a quarter."""

_READERS = {"MAVLINK20": "1", "MAVLINK_DIALECT": "ardupilotmega", "OPENBLAS_NUM_THREADS": "1"}
"""The environment of the process that reads: the MAVLink that pymavlink is to read, no threads."""


def read_log(path: Path, system: int | None = None) -> list[FlightRecord]:
    """Return the flights in a log: ArduPilot's `.bin`, `.tlog` of a ground station, PX4's `.ulg`.

    There are several where several vehicles tell their positions in a `.tlog`, unless `system`
    names one. A log that ends in the middle is read as far as it goes. It is read in a process of
    its own, which runs no code of the current directory. Raises `InputError` for anything else.
    """
    _check(path)
    if system is not None and path.suffix.lower() != ".tlog":
        raise InputError(f"--system {system}: {path} is the log of one vehicle; that is for .tlog")
    return flights(path, _told(path), system)


def _check(path: Path) -> None:
    """Raise `InputError` for what is no log, as its name, size and first bytes tell."""
    ending = path.suffix.lower()
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    if not 0 < path.stat().st_size <= _LARGEST:
        raise InputError(f"{path}: empty, or larger than {_LARGEST:,} bytes; expected a flight log")
    try:
        with path.open("rb") as file:
            if b"FMT," in file.read(_BEGINNING):
                what = "ArduPilot's log as text; give the .bin that it was made from"
                raise InputError(f"{path}: {what}")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    if ending not in _ENDINGS:
        raise InputError(f"{path}: give a flight log: {', '.join(_ENDINGS)}")
    if ending == ".ulg":
        check_extra("debrief", "pyulog", f"{path}: a log of PX4")


def _told(path: Path) -> Iterator[Said]:
    """Yield what the program `log_messages` says of a log, in the time that it has."""
    command = [sys.executable, "-P", log_messages.__file__, str(path)]
    with TemporaryFile() as out:
        try:
            ended = subprocess.run(
                command,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.PIPE,
                env=os.environ | _READERS,
                timeout=_PATIENCE,
                check=False,
            )
        except subprocess.TimeoutExpired:
            what = f"not read within {_PATIENCE:g} s"
            raise InputError(f"{path}: {what}; expected the log of a flight") from None
        if ended.returncode:
            reason = ended.stderr.decode(errors="replace").strip()
            reason = reason or f"its reader ended with status {ended.returncode}"
            raise InputError(
                f"{path}: not a {path.suffix} log: {shortened(reason, _LONGEST_REASON)}"
            )
        out.seek(0)
        yield from map(json.loads, out)
