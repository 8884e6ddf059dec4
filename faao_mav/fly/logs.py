"""Flights from the logs of autopilots and ground stations.

Logs are read by the libraries of those who made the formats, which take minutes and gigabytes for
files that are no logs: so in a process of its own. That is this module, run as a program, which
writes what a log says as lines of JSON, and where it fails the reason to standard error.

Sources: ArduPilot, "Log messages"; MAVLink, "File formats"; PX4, "ULog file format".
"""

import json
import math
import os
import subprocess
import sys
from array import array
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, suppress
from operator import itemgetter
from pathlib import Path
from tempfile import TemporaryFile
from typing import TextIO, TypeAlias

import numpy as np

from faao_mav.errors import InputError, check_extra, shortened
from faao_mav.fly.record import Fix, FlightRecord

Said: TypeAlias = tuple[int, int, str, dict[str, float | str]]
"""System and component of MAVLink that said it, 0 in a vehicle's own log; name; values by field."""

_ENDINGS = (".bin", ".tlog", ".ulg")

_WINDS = {
    **dict.fromkeys(("XKF2", "NKF2"), ("VWE", "VWN", "C")),
    "WIND_COV": ("wind_y", "wind_x"),
    "WIND": ("direction", "speed"),
    **dict.fromkeys(("wind", "wind_estimate"), ("windspeed_east", "windspeed_north", "timestamp")),
}
"""Messages about wind, newer ones first: the fields of what blows east and north, and others."""

_FIELDS = {
    "POS": ("TimeUS", "Lat", "Lng", "Alt", "RelHomeAlt"),
    "GLOBAL_POSITION_INT": ("time_boot_ms", "lat", "lon", "alt", "relative_alt"),
    "vehicle_global_position": ("timestamp", "lat", "lon", "alt"),
    "home_position": ("timestamp", "alt", "valid_alt"),
    "PARM": ("Name", "Value"),
    "PARAM_VALUE": ("param_id", "param_value"),
    **_WINDS,
}
"""The messages that are read, and their fields, of which older firmware lacks some."""

_LARGEST = 2**30
"""Bytes of a log that is read; chosen: hours of a `.bin`."""

_PATIENCE, _BYTES = 60, 2_000_000_000
"""Seconds after which reading a log is given up, processor time too, and the memory that it may
take; chosen: four times and twice what a `.bin` of 10^9 bytes takes."""

_MOST_MESSAGES = 1_000_000
"""Messages about the flight, of which a log has no more; chosen: nine hours, thrice at 10 Hz."""

_LEAST, _LONGEST = 10, 86_400.0
"""Positions that a flight has at least, and seconds that it lasts at most; chosen."""

_REBOOT, _BETWEEN = 2.0, 1000.0
"""Seconds by which a vehicle's clock goes back when it has booted again, less is a late packet; and
the seconds that are put there, and for any longer pause. Chosen: no flight goes on across them."""

_BOUNDS = (1e8, 90.0, 180.0, 1e5)
"""What no position is beyond: s, degrees, degrees and m; chosen."""

_FASTEST_WIND = 100.0
"""m/s, in which nothing flies; chosen."""

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
    """Raise `InputError` for what is no log, as its name and size tell."""
    ending = path.suffix.lower()
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    if ending not in _ENDINGS:
        raise InputError(f"{path}: give a flight log: {', '.join(_ENDINGS)}")
    if not 0 < path.stat().st_size <= _LARGEST:
        raise InputError(f"{path}: empty, or larger than {_LARGEST:,} bytes; expected a flight log")
    if ending == ".ulg":
        check_extra("debrief", "pyulog", f"{path}: a log of PX4")


def _told(path: Path) -> Iterator[Said]:
    """Yield what the process that reads a log says of it, in the time that it has."""
    command = [sys.executable, "-P", "-m", __name__, str(path)]
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
            text = f"{path}: not read within {_PATIENCE:g} s; expected the log of a flight"
            raise InputError(text) from None
        if ended.returncode:
            reason = ended.stderr.decode(errors="replace").strip() or "its reader was ended"
            raise InputError(f"{path}: not a {path.suffix} log: {shortened(reason)}")
        out.seek(0)
        yield from map(json.loads, out)


def flights(path: Path, said: Iterable[Said], system: int | None = None) -> list[FlightRecord]:
    """Return the flights of the vehicles that tell their positions in the log `path`.

    `system` chooses one. Of a system the component with the lowest number counts, which is the
    autopilot: a companion may have a clock, a position and a wind of its own. Raises `InputError`
    where there is no flight.
    """
    heard = defaultdict[tuple[int, int], _Heard](_Heard)
    for number, component, name, fields in said:
        heard[number, component].hear(name, fields)
    flown = dict[int, FlightRecord]()
    for (number, _), each in sorted(heard.items(), key=itemgetter(0)):
        if each.count >= _LEAST:
            flown.setdefault(number, each.record(number))
    if not flown:
        most = max((each.count for each in heard.values()), default=0)
        raise InputError(f"{path}: {most} positions; expected the log of a flight")
    if system is not None and system not in flown:
        numbers = ", ".join(map(str, filter(None, flown)))
        raise InputError(f"--system {system}: not in {path}, where positions are of: {numbers}")
    chosen = [each for number, each in flown.items() if system in (None, number)]
    longest = max(each.t[-1] - each.t[0] for each in chosen)
    if longest > _LONGEST:
        raise InputError(f"{path}: {longest / 3600:.0f} hours; expected the log of a flight")
    return chosen


class _Heard:
    """What one sender has said of its flight."""

    def __init__(self) -> None:
        self._rows = array("d")
        self._last = self._later = math.nan
        self._home = math.nan
        self._estimator, self._wind = len(_WINDS), (math.nan, math.nan)
        self._parameters: dict[str, float] = {}

    @property
    def count(self) -> int:
        """How many positions it has told."""
        return len(self._rows) // len(Fix._fields)

    def hear(self, name: str, said: Mapping[str, float | str]) -> None:
        """Take note of a message."""
        told = [said.get(field, math.nan) for field in _FIELDS[name]]
        match name, [math.nan if isinstance(each, str) else each for each in told]:
            case "GLOBAL_POSITION_INT", [t, latitude, longitude, altitude, height]:
                place = latitude / 1e7, longitude / 1e7, altitude / 1e3, height / 1e3
                self._be(t / 1e3, *place)
            case "POS" | "vehicle_global_position", [t, *rest]:
                self._be(t / 1e6, *rest)
            case "home_position", [_, altitude, valid]:
                self._home = altitude if valid else self._home
            case "PARM" | "PARAM_VALUE", [_, value]:
                if math.isfinite(value):
                    self._parameters[str(told[0])] = value
            case "WIND", [source, speed]:  # from where it blows, degrees
                angle = math.radians(source)
                self._blow(name, -speed * math.sin(angle), -speed * math.cos(angle))
            case _, [east, north, *_] if said.get("C", 0) == 0:  # the first of the estimators
                self._blow(name, east, north)

    def _be(
        self, t: float, latitude: float, longitude: float, altitude: float, height: float = math.nan
    ) -> None:
        """Take note of a position: s, degrees, degrees, m above the sea and above home.

        Over boots and pauses times go on; what comes late is left out, and what is none.
        """
        place = latitude, longitude, altitude
        sound = all(abs(x) <= most for x, most in zip((t, *place), _BOUNDS, strict=True))
        if not sound or not (latitude or longitude):
            return
        step = t - self._last
        if math.isnan(step):
            self._later = 0.0
        elif step < -_REBOOT or step > _BETWEEN:
            self._later += _BETWEEN - step
        elif step <= 0:
            return
        self._last = t
        if abs(height) <= _BOUNDS[-1]:
            self._home = altitude - height
        self._rows.extend((t + self._later, *place, self._home, *self._wind))

    def _blow(self, name: str, east: float, north: float) -> None:
        """Take note of a wind, if no better estimator tells one; one that does not run tells 0."""
        rank = [*_WINDS].index(name)
        told = (east or north) and math.hypot(east, north) <= _FASTEST_WIND
        if rank <= self._estimator and told:
            self._estimator, self._wind = rank, (east, north)

    def record(self, system: int) -> FlightRecord:
        """Return the flight; `system` is 0 without one.

        Until home is told it is where it was first told, or else where the first position is.
        """
        found = FlightRecord.of(self._rows, self._parameters, system)
        home, known = found.home, np.isfinite(found.home)
        home[: np.argmax(known)] = home[np.argmax(known)]
        home[np.isnan(home)] = found.altitude[0]
        return found


# ---- the process that reads


def messages(path: Path) -> Iterator[Said]:
    """Yield the messages in a `.bin`, `.tlog` or `.ulg` that say where the vehicle was, and how.

    Those of a `.ulg` come in the order of their times, others as they were written. Raises whatever
    the libraries raise.
    """
    ending = path.suffix.lower()
    return _ulog(path) if ending == ".ulg" else _mavlog(path, own=ending == ".bin")


def _mavlog(path: Path, *, own: bool) -> Iterator[Said]:
    from pymavlink import DFReader, mavutil

    try:
        log = DFReader.DFReader_binary(str(path)) if own else mavutil.mavmmaplog(str(path))
    except AttributeError:  # a log that ends in the first message of its kind
        log = mavutil.mavlogfile(str(path))  # which takes ten times as long
    with closing(log):
        while (message := log.recv_match(type=[*_FIELDS])) is not None:
            name = message.get_type()
            values = {field: getattr(message, field, None) for field in _FIELDS[name]}
            known = {key: x for key, x in values.items() if isinstance(x, (int, float, str))}
            sender = (0, 0) if own else (message.get_srcSystem(), message.get_srcComponent())
            yield *sender, name, known


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
        for limit, most in (("RLIMIT_CPU", _PATIENCE), ("RLIMIT_DATA", _BYTES)):
            with suppress(ImportError, ValueError):  # Windows; the user's own limit is lower
                import resource

                resource.setrlimit(getattr(resource, limit), (most, most))
        try:
            write(path, out)
        except Exception as error:  # what libraries make of files that are something else
            print(f"{type(error).__name__}: {error}", file=failed)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(_main(Path(sys.argv[1])))
