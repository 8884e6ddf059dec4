"""Flights from the logs of autopilots and ground stations."""

import math
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import TypeAlias

import numpy as np

from faao_mav.errors import InputError
from faao_mav.mavlink.flying.log_messages import bin_messages, sound_ulog, tlog_messages
from faao_mav.mavlink.flying.record import FlightRecord

_REBOOT, _BETWEEN = 2.0, 1000.0
"""Seconds by which a vehicle's clock goes back when it has booted again, less is a late packet; and
the seconds that are put between two boots. Chosen: no flight goes on across them."""

_LEAST = 10
"""Positions that a flight has at least; chosen."""

_LARGEST = 2**30
"""Bytes of a log that is read; chosen: hours of a `.bin`."""

_Fix: TypeAlias = tuple[float, float, float, float]
"""Time, s; latitude and longitude, degrees; height above home, m."""

_Wind: TypeAlias = tuple[float, float, float]
"""Time, s; wind towards east and north, m/s."""


def read_log(path: Path) -> FlightRecord:
    """Return the flight in a log: ArduPilot's `.bin`, `.tlog` of a ground station, PX4's `.ulg`.

    Positions are the autopilot's own estimate (POS, GLOBAL_POSITION_INT, vehicle_global_position).
    A log that ends in the middle is read as far as it goes. In a `.tlog` the first vehicle that
    tells its position counts. Raises `InputError` for anything else.
    """
    readers: dict[str, Callable[[Path], FlightRecord]]
    readers = {".bin": _read_bin, ".tlog": _read_tlog, ".ulg": _read_ulg}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: give a flight log: {', '.join(readers)}")
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    if not 0 < path.stat().st_size <= _LARGEST:
        raise InputError(f"{path}: empty, or larger than {_LARGEST:,} bytes; expected a flight log")
    try:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):  # the readers' own remarks
            record = reader(path)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except Exception as error:  # what readers make of files that are something else
        kind = type(error).__name__
        raise InputError(f"{path}: not a {path.suffix} log: {kind}: {error}") from error
    if len(record.t) < _LEAST:
        raise InputError(f"{path}: {len(record.t)} positions; expected the log of a flight")
    return record


def _read_bin(path: Path) -> FlightRecord:
    fixes: list[_Fix] = []
    winds: list[_Wind] = []
    parameters = {}
    for name, said in bin_messages(path, ("POS", "XKF2", "NKF2", "PARM")):
        if name == "POS":
            height = said.get("RelHomeAlt", math.nan)
            fixes.append((said["TimeUS"] / 1e6, said["Lat"], said["Lng"], height))
        elif name == "PARM":
            parameters[said["Name"]] = float(said["Value"])
        elif said.get("C", 0) == 0:  # the first of the estimators
            winds.append((said["TimeUS"] / 1e6, said["VWE"], said["VWN"]))
    return _record(fixes, winds, parameters)


def _read_tlog(path: Path) -> FlightRecord:
    fixes: list[_Fix] = []
    winds: list[_Wind] = []
    parameters = {}
    system = None
    names = ("GLOBAL_POSITION_INT", "WIND", "WIND_COV", "PARAM_VALUE")
    for message in tlog_messages(path, names):
        kind = message.get_type()
        if kind == "GLOBAL_POSITION_INT" and system in (None, message.get_srcSystem()):
            system = message.get_srcSystem()
            place = message.lat / 1e7, message.lon / 1e7, message.relative_alt / 1e3
            fixes.append((message.time_boot_ms / 1e3, *place))
        elif system != message.get_srcSystem():
            continue
        elif kind == "PARAM_VALUE":
            parameters[message.param_id] = float(message.param_value)
        elif fixes and kind == "WIND_COV":  # where the wind blows to
            winds.append((fixes[-1][0], message.wind_y, message.wind_x))
        elif fixes:  # where it comes from, degrees
            angle, speed = math.radians(message.direction), message.speed
            winds.append((fixes[-1][0], -speed * math.sin(angle), -speed * math.cos(angle)))
    return _record(fixes, winds, parameters)


def _read_ulg(path: Path) -> FlightRecord:
    try:
        from pyulog import ULog
    except ImportError:
        raise InputError(
            f"{path}: PX4's logs are read by pyulog: pip install 'faao-mav[debrief]'"
        ) from None
    names = ["vehicle_global_position", "home_position", "wind"]
    log = ULog(sound_ulog(path, names), names)
    topics = {each.name: each.data for each in log.data_list if each.multi_id == 0}
    if "vehicle_global_position" not in topics:
        raise InputError(f"{path}: no vehicle_global_position in this log")
    place = topics["vehicle_global_position"]
    t = place["timestamp"] / 1e6
    ground = float(place["alt"][0])
    if "home_position" in topics:
        ground = float(topics["home_position"]["alt"][-1])
    fixes = zip(t, place["lat"], place["lon"], place["alt"] - ground, strict=True)
    winds: list[_Wind] = []
    if (wind := topics.get("wind")) is not None:
        columns = (wind["timestamp"] / 1e6, wind["windspeed_east"], wind["windspeed_north"])
        winds = list(zip(*columns, strict=True))
    parameters = {str(name): float(value) for name, value in log.initial_parameters.items()}
    return _record(list(fixes), winds, parameters)


def _record(fixes: list[_Fix], winds: list[_Wind], parameters: dict[str, float]) -> FlightRecord:
    """Return the record, of several boots one after the other."""
    table = np.array(fixes, dtype=float).reshape(-1, 4)
    table = table[np.isfinite(table).all(axis=1) & table[:, 1:3].any(axis=1)]
    steps = np.diff(table[:, 0], prepend=table[:1, 0])
    booted = steps < -_REBOOT
    table[:, 0] += np.cumsum(np.where(booted, _BETWEEN - steps, 0.0))
    newest = np.maximum.accumulate(np.concatenate([[-np.inf], table[:-1, 0]]))
    t, latitude, longitude, height = table[table[:, 0] > newest].T
    estimated = None if booted.any() else np.array(winds, dtype=float).reshape(-1, 3)
    return FlightRecord(t, latitude, longitude, height, estimated, parameters)
