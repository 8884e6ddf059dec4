"""Flights from the logs of autopilots and ground stations.

Logs are read by the libraries of those who made the formats, which take minutes and gigabytes for
files that are no logs: so by a process of its own. That is this module, run as a program, which
writes flights as JSON, or the reason why there is none.

Sources: ArduPilot, "Log messages"; MAVLink, "File formats"; PX4, "ULog file format".
"""

import json
import math
import os
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, redirect_stderr, redirect_stdout, suppress
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from faao_mav.errors import InputError, check_extra, shortened

if TYPE_CHECKING:
    from faao_mav.validate.flown import FlightRecord

Said: TypeAlias = tuple[int, int, str, Mapping[str, Any]]
"""System and component of MAVLink that said it, 0 in a vehicle's own log; name; values by field."""

_TOLD: dict[str, tuple[str, dict[str, float]]] = {
    "POS": ("place", {"TimeUS": 1e6, "Lat": 1, "Lng": 1, "Alt": 1, "RelHomeAlt": 1}),
    "GLOBAL_POSITION_INT": (
        "place", {"time_boot_ms": 1e3, "lat": 1e7, "lon": 1e7, "alt": 1e3, "relative_alt": 1e3},
    ),
    "vehicle_global_position": ("place", {"timestamp": 1e6, "lat": 1, "lon": 1, "alt": 1}),
    "home_position": ("home", {"alt": 1}),
    "PARM": ("Name", {"Value": 1}),
    "PARAM_VALUE": ("param_id", {"param_value": 1}),
    "XKF2": ("wind", {"VWE": 1, "VWN": 1}),
    "WIND_COV": ("wind", {"wind_y": 1, "wind_x": 1}),
    "WIND": ("whence", {"direction": 1, "speed": 1}),
    "wind": ("wind", {"windspeed_east": 1, "windspeed_north": 1}),
    "RADIO_STATUS": ("radio", {"rssi": 1}),
    "RADIO": ("radio", {"rssi": 1}),
    "RAD": ("radio", {"RSSI": 1}),
    "radio_status": ("radio", {"rssi": 1}),
}  # fmt: skip
"""The messages that are read: what they tell, and what their fields count in a second, a degree and
a metre. Of a place the time, latitude, longitude, the height above the sea and that above home; of
the wind how fast it blows to east and north, or whence it blows, degrees, and how fast; of a
telemetry radio the level. A parameter has its name in the field that is told first."""

_UNKNOWN = 255  # The level of a radio that does not know it (MAVLink, RADIO_STATUS).

_LARGEST, _MOST_MESSAGES = 2**30, 1_000_000
"""Bytes of a log that is read, and messages about the flight that it has at most; chosen: hours of
a `.bin`, and nine hours, thrice at 10 Hz."""

_PATIENCE, _BYTES = 60, 2_000_000_000
"""Seconds after which reading a log is given up, processor time too, and the memory that it may
take; chosen: four times and twice what a `.bin` of 10^9 bytes takes."""

_LEAST, _LONGEST = 10, 86_400.0
"""Positions that a flight has at least, and seconds that it lasts at most; chosen."""

_REBOOT, _BETWEEN = 2.0, 1000.0
"""Seconds by which a vehicle's clock goes back when it has booted again, less is a late packet; and
the seconds that are put there, and for any longer pause. Chosen: no flight goes on across them."""

_BOUNDS, _FASTEST_WIND = (1e8, 90.0, 180.0, 1e5), 100.0
"""What no position is beyond, s, degrees, degrees and m, and no wind, m/s; chosen."""

_ENVIRONMENT = {"MAVLINK20": "1", "MAVLINK_DIALECT": "ardupilotmega", "OPENBLAS_NUM_THREADS": "1"}
"""Of the process that reads: the MAVLink that pymavlink is to read, no threads."""


def read_log(path: Path, system: int | None = None) -> "list[FlightRecord]":
    """Return the flights in a log: ArduPilot's `.bin`, `.tlog` of a ground station, PX4's `.ulg`.

    There are several where several vehicles tell their positions in a `.tlog`, unless `system`
    names one. A log that ends in the middle is read as far as it goes. It is read in a process of
    its own, which runs no code of the current directory. Raises `InputError` for anything else.

    >>> (flight,) = read_log(Path("tests/data/logs/arducopter.tlog"))
    >>> flight.system, bool(flight.t[-1] - flight.t[0] > 60)
    (1, True)
    """
    from faao_mav.validate.flown import FlightRecord  # which that process need not import

    ending = path.suffix.lower()
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    if ending not in (".bin", ".tlog", ".ulg"):
        raise InputError(f"{path}: give a flight log: .bin, .tlog, .ulg")
    if not 0 < path.stat().st_size <= _LARGEST:
        raise InputError(f"{path}: empty, or larger than {_LARGEST:,} bytes; expected a flight log")
    if ending == ".ulg":
        check_extra("debrief", "pyulog", f"{path}: a log of PX4")
    if system is not None and ending != ".tlog":
        raise InputError(f"--system {system}: {path} is the log of one vehicle; that is for .tlog")
    command = [sys.executable, "-P", "-m", __name__, str(path), str(system or 0)]
    environment = os.environ | _ENVIRONMENT
    try:
        read = subprocess.run(
            command, capture_output=True, env=environment, timeout=_PATIENCE, check=False
        )
    except subprocess.TimeoutExpired:
        text = f"{path}: not read within {_PATIENCE:g} s; expected the log of a flight"
        raise InputError(text) from None
    if read.returncode:
        said = read.stderr.decode(errors="replace").strip()  # by the libraries too
        reason = said.rpartition("\n")[2]
        raise InputError(reason or f"{path}: not a {ending} log: its reader was ended")
    return [FlightRecord.of(*each) for each in json.loads(read.stdout)]


Flown: TypeAlias = tuple[list[tuple[float, ...]], dict[str, float], int]
"""What `FlightRecord.of` takes: for each position what a `Fix` has."""


def flights(path: Path, said: Iterable[Said], system: int = 0) -> list[Flown]:
    """Return the flights of the vehicles that tell their positions in the log `path`.

    `system` chooses one. Of a system the component with the lowest number counts, which is the
    autopilot: a companion may have a clock, a position and a wind of its own. Raises `InputError`
    where there is no flight.
    """
    heard, expected = defaultdict[tuple[int, int], _Heard](_Heard), "expected the log of a flight"
    for count, (number, component, name, fields) in enumerate(said):
        if count == _MOST_MESSAGES:
            what = "positions, winds and parameters"
            raise InputError(f"{path}: more than {count:,} {what}; {expected}")
        if _TOLD[name][0] == "radio" and number:  # told by the radio itself, which has no place
            for each in heard.values():
                each.hear(name, fields)
        else:
            heard[number, component].hear(name, fields)
    flown = dict[int, _Heard]()
    for (number, _), each in sorted(heard.items(), key=itemgetter(0)):
        if len(each.fixes) >= _LEAST:
            flown.setdefault(number, each)
    if not flown:
        most = max((len(each.fixes) for each in heard.values()), default=0)
        raise InputError(f"{path}: {most} positions; {expected}")
    if system and system not in flown:
        numbers = ", ".join(map(str, filter(None, flown)))
        raise InputError(f"--system {system}: not in {path}, where positions are of: {numbers}")
    chosen = {number: each for number, each in flown.items() if system in (0, number)}
    longest = max(each.fixes[-1][0] - each.fixes[0][0] for each in chosen.values())
    if longest > _LONGEST:
        raise InputError(f"{path}: {longest / 3600:.0f} hours; {expected}")
    return [(each.found(), each.parameters, number) for number, each in chosen.items()]


class _Heard:
    """What one sender has said of its flight: `fixes`, and `parameters` by name."""

    def __init__(self) -> None:
        self.fixes: list[tuple[float, ...]] = []
        self.parameters: dict[str, float] = {}
        self._last, self._later, self._home = math.nan, 0.0, math.nan
        self._wind, self._rssi = (math.nan, math.nan), math.nan

    def hear(self, name: str, said: Mapping[str, Any]) -> None:
        """Take note of a message."""
        what, units = _TOLD[name]
        told = ((said.get(field), unit) for field, unit in units.items())
        values = [x / unit if isinstance(x, int | float) else math.nan for x, unit in told]
        match what:
            case "place":
                self._be(*values)
            case "home":
                self._home = values[0] if said.get("valid_alt", True) else self._home
            case "radio":
                self._rssi = math.nan if values[0] == _UNKNOWN else values[0]
            case "wind" | "whence":
                east, north = values
                if what == "whence":
                    angle, speed = math.radians(east), north
                    east, north = -speed * math.sin(angle), -speed * math.cos(angle)
                # One that does not run tells 0; the first of the estimators counts.
                if 0 < math.hypot(east, north) <= _FASTEST_WIND and not said.get("C", 0):
                    self._wind = east, north
            case _ if math.isfinite(values[0]):
                self.parameters[str(said.get(what))] = values[0]

    def _be(
        self, t: float, latitude: float, longitude: float, altitude: float, height: float = math.nan
    ) -> None:
        """Take note of a position: s, degrees, degrees, m above the sea and above home.

        Over boots and pauses times go on; what comes late is left out, and what is none.
        """
        place = latitude, longitude, altitude
        sound = all(abs(x) <= most for x, most in zip((t, *place), _BOUNDS, strict=True))
        step = t - self._last
        late = -_REBOOT <= step <= 0
        if late or not sound or not (latitude or longitude):
            return
        if step < -_REBOOT or step > _BETWEEN:
            self._later += _BETWEEN - step
        self._last = t
        if abs(height) <= _BOUNDS[-1]:
            self._home = altitude - height
        self.fixes.append((t + self._later, *place, self._home, *self._wind, self._rssi))
        self._rssi = math.nan

    def found(self) -> list[tuple[float, ...]]:
        """Return the flight; until home is told it is where it is first told, or where it began."""
        homes = (each[4] for each in self.fixes)
        first = next(filter(math.isfinite, homes), self.fixes[0][3])
        return [(*x[:4], x[4] if math.isfinite(x[4]) else first, *x[5:]) for x in self.fixes]


def messages(path: Path) -> Iterator[Said]:
    """Yield the messages in a `.bin`, `.tlog` or `.ulg` that say where the vehicle was, and how.

    Those of a `.ulg` come in the order of their times, others as they were written. Raises whatever
    the libraries raise.
    """
    ending = path.suffix.lower()
    if ending == ".ulg":
        yield from _ulog(path)
        return
    from pymavlink import DFReader, mavutil

    own = ending == ".bin"
    try:
        log = DFReader.DFReader_binary(str(path)) if own else mavutil.mavmmaplog(str(path))
    except AttributeError:  # a log that ends in the first message of its kind
        log = mavutil.mavlogfile(str(path))  # which takes ten times as long
    with closing(log):
        while (message := log.recv_match(type=list(_TOLD))) is not None:
            sender = (0, 0) if own else (message.get_srcSystem(), message.get_srcComponent())
            yield *sender, message.get_type(), message.to_dict()


def _ulog(path: Path) -> Iterator[Said]:
    from pyulog import ULog

    with path.open("rb") as file:
        log = ULog(file, list(_TOLD))
    for name, value in log.initial_parameters.items():
        yield 0, 0, "PARM", {"Name": name, "Value": value}
    rows: list[tuple[float, str, dict[str, float]]] = []
    for topic in log.data_list:
        if topic.multi_id == 0:
            columns = [values.tolist() for values in topic.data.values()]
            told = (dict(zip(topic.data, row, strict=True)) for row in zip(*columns, strict=True))
            rows += [(row["timestamp"], topic.name, row) for row in told]
    for _, name, row in sorted(rows, key=itemgetter(0)):
        yield 0, 0, name, row


def _main(path: Path, system: int) -> None:
    for limit, most in (("RLIMIT_CPU", _PATIENCE), ("RLIMIT_DATA", _BYTES)):
        with suppress(ImportError, ValueError):  # Windows; the user's own limit is lower
            import resource

            resource.setrlimit(getattr(resource, limit), (most, most))
    try:
        # The libraries' own remarks go nowhere: they are a line for each byte of zeros.
        with Path(os.devnull).open("w") as out, redirect_stdout(out), redirect_stderr(out):
            found = json.dumps(flights(path, messages(path), system))
    except InputError as error:
        sys.exit(str(error))
    except Exception as error:  # what libraries make of files that are something else
        reason = shortened(f"{type(error).__name__}: {error}")
        sys.exit(f"{path}: not a {path.suffix} log: {reason}")
    sys.stdout.write(found)


if __name__ == "__main__":
    _main(Path(sys.argv[1]), int(sys.argv[2]))
