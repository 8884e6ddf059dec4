"""What the log of a flight says of it, read by the libraries of those who made the formats.

Run as a program this writes the messages of one log as lines of JSON, and where it fails the reason
to standard error. `faao_mav.fly.logs` runs it: the libraries take minutes and gigabytes
for files that are no logs. It imports nothing of this package, so that it starts at once.

Sources: ArduPilot, "Log messages"; MAVLink, "File formats"; PX4, "ULog file format".
"""

import json
import os
import sys
from collections.abc import Iterator
from contextlib import closing, suppress
from operator import itemgetter
from pathlib import Path
from typing import Any, TextIO, TypeAlias

Said: TypeAlias = tuple[int, int, str, dict[str, float | str]]
"""System and component of MAVLink that said it, 0 in a vehicle's own log; name; values by field."""

_FIELDS = {
    "POS": ("TimeUS", "Lat", "Lng", "Alt", "RelHomeAlt", "RelAlt", "RelOriginAlt"),
    **dict.fromkeys(("XKF2", "NKF2", "EKF2"), ("C", "VWE", "VWN")),
    "PARM": ("Name", "Value"),
    "GLOBAL_POSITION_INT": ("time_boot_ms", "lat", "lon", "alt", "relative_alt"),
    "WIND": ("direction", "speed"),
    "WIND_COV": ("wind_x", "wind_y"),
    "PARAM_VALUE": ("param_id", "param_value"),
    "home_position": ("timestamp", "alt", "valid_alt"),
    "vehicle_global_position": ("timestamp", "lat", "lon", "alt"),
    **dict.fromkeys(
        ("wind", "wind_estimate", "estimator_wind"),
        ("timestamp", "windspeed_east", "windspeed_north"),
    ),
}
"""The messages that are read, and their fields, of which older firmware lacks some."""

_MOST_MESSAGES = 1_000_000
"""Messages about the flight, of which a log has no more; chosen: nine hours, thrice at 10 Hz."""

_SECONDS, _BYTES = 60, 2_000_000_000
"""Processor time and memory of the program, where the system limits them; chosen: four times and
twice what 10^9 bytes of a `.bin` take."""


def messages(path: Path) -> Iterator[Said]:
    """Yield the messages in a `.bin`, `.tlog` or `.ulg` that say where the vehicle was, and how.

    Those of a `.ulg` come in the order of their times, others as they were written. Raises whatever
    the libraries raise.
    """
    read = {".bin": _dataflash, ".tlog": _telemetry, ".ulg": _ulog}[path.suffix.lower()]
    yield from read(path)


def _dataflash(path: Path) -> Iterator[Said]:
    from pymavlink.DFReader import DFReader_binary

    with closing(DFReader_binary(str(path))) as log:
        while (message := log.recv_match(type=[*_FIELDS])) is not None:
            yield 0, 0, *_chosen(message)


def _telemetry(path: Path) -> Iterator[Said]:
    from pymavlink import mavutil

    try:
        log = mavutil.mavmmaplog(str(path))  # ten times as fast as the other
    except AttributeError:  # a log that ends in the first message of its kind
        log = mavutil.mavlogfile(str(path))
    with closing(log):
        while (message := log.recv_match(type=[*_FIELDS])) is not None:
            yield message.get_srcSystem(), message.get_srcComponent(), *_chosen(message)


def _chosen(message: Any) -> tuple[str, dict[str, float | str]]:
    """Return the name and the fields of a message of pymavlink."""
    name = message.get_type()
    values = ((field, getattr(message, field, None)) for field in _FIELDS[name])
    return name, {field: value for field, value in values if isinstance(value, (int, float, str))}


def _ulog(path: Path) -> Iterator[Said]:
    from pyulog import ULog

    with path.open("rb") as file:
        log = ULog(file, [*_FIELDS])
    for name, value in log.initial_parameters.items():
        yield 0, 0, "PARM", {"Name": name, "Value": value}
    rows: list[tuple[float, str, dict[str, float | str]]] = []
    for topic in log.data_list:
        if topic.multi_id == 0:
            fields = [field for field in _FIELDS[topic.name] if field in topic.data]
            for values in zip(*(topic.data[field].tolist() for field in fields), strict=True):
                row = dict(zip(fields, values, strict=True))
                rows.append((row["timestamp"], topic.name, row))
    for _, name, row in sorted(rows, key=itemgetter(0)):
        yield 0, 0, name, row


def write(path: Path, out: TextIO) -> None:
    """Write the messages of a log to `out`, one in a line of JSON."""
    for count, said in enumerate(messages(path)):
        if count == _MOST_MESSAGES:
            raise ValueError(f"more than {_MOST_MESSAGES:,} positions, winds and parameters")
        print(json.dumps(said), file=out)


def _main(path: Path) -> int:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    with os.fdopen(os.dup(1), "w") as out, os.fdopen(os.dup(2), "w") as failed:
        for number in (1, 2):  # for the libraries' own remarks, a line for each byte of zeros
            os.dup2(nowhere, number)
        try:
            _limit()
            write(path, out)
        except Exception as error:  # what libraries make of files that are something else
            print(f"{type(error).__name__}: {error}", file=failed)
            return 1
    return 0


def _limit() -> None:
    """Limit the processor time and memory of this process."""
    try:
        import resource
    except ImportError:  # Windows
        return
    for kind, most in ((resource.RLIMIT_CPU, _SECONDS), (resource.RLIMIT_DATA, _BYTES)):
        with suppress(ValueError):  # the user's own limit is lower
            resource.setrlimit(kind, (most, most))


if __name__ == "__main__":
    sys.exit(_main(Path(sys.argv[1])))
