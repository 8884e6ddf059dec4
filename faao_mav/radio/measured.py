"""Levels of a link that were measured in flight: their units, and tables of them (CSV)."""

import csv
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.files import read_text
from faao_mav.geodesy import LocalFrame
from faao_mav.radio.fit import Samples

_MOST_BYTES = 200_000_000
"""Bytes of a table that are read at most; chosen: a day of ten rows a second."""

_FARTHEST = 100_000.0
"""Metres from the station beyond which positions are taken for mistaken. Chosen."""

_SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6}
_DEGREES = {"": 1.0, "deg": 1.0, "degrees": 1.0}
_METRES = {"m": 1.0, "meters": 1.0, "metres": 1.0, "ft": 0.3048, "feet": 0.3048}
_MBIT_PER_S = {
    unit.format(prefix): size
    for prefix, size in (("m", 1.0), ("k", 1e-3), ("", 1e-6))
    for unit in ("{}bit/s", "{}bps", "{}bit_per_s")
}
_COLUMNS: Mapping[str, tuple[str, Mapping[str, float]]] = {
    "time": ("time timestamp t seconds", _SECONDS),
    "latitude": ("latitude lat", _DEGREES),
    "longitude": ("longitude lon lng long", _DEGREES),
    "altitude": ("altitude alt height", _METRES),
    "rsrp": ("rsrp", {"dbm": 1.0}),
    "rssi": ("rssi power signal", {"dbm": 1.0, "sik": 1.0, "raw": 1.0}),
    "snr": ("snr sinr", {"db": 1.0}),
    "throughput": ("throughput rate goodput", _MBIT_PER_S),
}
"""What a table's header may call its columns, of which the last four are levels, and their units in
s, degrees, m, dB and Mbit/s. `sik` is what SiK radios count, `raw` is any other device's count."""

_PLACES, _LEVELS = tuple(_COLUMNS)[:4], tuple(_COLUMNS)[4:]
_CALLED = {word: name for name, (words, _) in _COLUMNS.items() for word in words.split()}

SIK_STEP, _SIK_AT_ZERO = 1.0 / 1.9, -127.0
"""dB a count of a SiK radio, and dBm that it counts as 0 (ArduPilot, "SiK Radio: Advanced
Configuration", which calls it approximate)."""

Calibration: TypeAlias = Sequence[Sequence[float]]
"""Counts of a device, and the dBm that they are: one or two."""

_SOUND = {"dbm": (-200.0, 60.0), "db": (-60.0, 120.0)}
"""The least and the greatest level of a unit; beyond them it is another unit."""


@dataclass(frozen=True, slots=True)
class Measured:
    """What was measured in a flight: `samples`, the `unit` of their levels, rows left out.

    The unit is `dbm` of received power, `db` of signal to noise, or `mbit/s`.
    """

    samples: Samples
    unit: str
    left_out: int = 0


def read_measured(
    path: str | Path,
    station: Sequence[float],
    units: Mapping[str, str] = MappingProxyType({}),
    calibration: Calibration = (),
) -> Measured:
    r"""Return the flight in the table `path`: time, latitude, longitude, altitude and one level.

    Levels are rsrp, rssi, snr or throughput. `station` is latitude and longitude, degrees, and
    height, m, of the antenna of the station, above what the altitudes are above. `units` are those
    of columns whose header does not tell them; `calibration` is a device's. Rows without a number
    are left out. Raises `InputError` for anything else.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder) / "flight.csv"
    ...     text = "time_s,lat,lon,alt_m,rssi_dbm\n0,47.001,8.0,60,-70\n"
    ...     _ = table.write_text(text)
    ...     found = read_measured(table, (47.0, 8.0, 10.0))
    >>> found.unit, found.samples.place.round().tolist(), found.samples.level.tolist()
    ('dbm', [[0.0, 111.0, 50.0]], [-70.0])
    """
    path = Path(path)
    if unknown := units.keys() - _COLUMNS.keys():
        text = f"--unit {min(unknown)}: no such column; give one of {', '.join(_COLUMNS)}"
        raise InputError(text)
    text = read_text(path, _MOST_BYTES, "a table of measured levels", InputError)
    lines = (line for line in text.splitlines() if line.strip() and not line.startswith("#"))
    header = next(lines, "")
    delimiter = max(";\t,", key=header.count)
    names = next(csv.reader([header], delimiter=delimiter), [])
    columns, unit_of = _columns(path, names, units)
    try:
        rows = _numbers(csv.reader(lines, delimiter=delimiter), columns, comma=delimiter == ";")
    except csv.Error as error:
        raise InputError(f"{path}: {error}; expected rows of numbers") from None
    level = next(name for name in columns if name in _LEVELS)
    sound = np.isfinite(rows).all(axis=1)
    if not sound.any():
        raise InputError(f"{path}: no row with {', '.join(columns)}; expected the rows of a flight")
    kept = {
        name: values * _COLUMNS[name][1][unit_of[name]]
        for name, values in zip(columns, rows[sound].T, strict=True)
    }
    told, unit = level_of(path, kept[level], unit_of[level], calibration)
    samples = samples_at(path, station, [kept[name] for name in _PLACES], told)
    return Measured(samples, unit, int(np.sum(~sound)))


def level_of(path: Path, told: Real, unit: str, calibration: Calibration = ()) -> tuple[Real, str]:
    """Return levels `told` (k,) in `unit` as those of a `Measured`, and their unit.

    Counts are linear in dBm through the points of the `calibration`; with one point, or none, they
    have the steps, or all, of SiK radios. Raises `InputError` for levels that are none in that
    unit, and where counts would need another calibration.
    """
    if unit in ("sik", "raw"):
        if unit == "raw" and len(calibration) < 2:
            raise InputError(
                f"{path}: a device's own counts; expected two of them in dBm by --calibrate "
                "COUNT=DBM, or --unit rssi=sik, the counts of SiK radios"
            )
        slope, level = SIK_STEP, _SIK_AT_ZERO
        (count, level), *more = calibration or [(0.0, level)]
        for other, dbm in more:
            slope = (dbm - level) / (other - count)
        told, unit = level + slope * (told - count), "dbm"
    unit = unit if unit in _SOUND else "mbit/s"
    least, most = _SOUND.get(unit, (-math.inf, math.inf))
    middle = float(np.median(told))
    if not least <= middle <= most:
        text = f"levels about {middle:g} {unit}; expected {least:g} to {most:g}: is that the unit?"
        raise InputError(f"{path}: {text}")
    return told, unit


def samples_at(path: Path, station: Sequence[float], at: Sequence[Real], level: Real) -> Samples:
    """Return levels (k,) of the log `path` as `Samples`; see `read_measured`.

    `at` are their times, s, latitudes and longitudes, degrees, and altitudes, m, each (k,).
    """
    t, latitude, longitude, altitude = at
    if np.abs(latitude).max() > 90.0 or np.abs(longitude).max() > 360.0:
        raise InputError(f"{path}: a latitude beyond 90 or a longitude beyond 360 degrees")
    local = LocalFrame(station[0], station[1]).to_local(latitude, longitude)
    away = float(np.median(np.hypot(*local.T)))
    if not away < _FARTHEST:
        raise InputError(
            f"{path}: {away / 1000:,.0f} km from --station {station[0]:g},{station[1]:g}; expected "
            "a flight about it: are latitude and longitude exchanged?"
        )
    order = np.argsort(t, kind="stable")
    place = np.column_stack([local, altitude - station[2]])
    return Samples(t[order], place[order], level[order], path.name)


def _columns(
    path: Path, header: list[str], units: Mapping[str, str]
) -> tuple[dict[str, int], dict[str, str]]:
    """Return by quantity the number of its column in `header`, and its unit."""
    columns, unit_of = dict[str, int](), dict[str, str]()
    for number, told in enumerate(header):
        words = re.findall(r"[^\s_()\[\],]+", told.lower())
        name = _CALLED.get(words[0]) if words else None
        if name is not None and name not in columns:
            columns[name] = number
            unit_of[name] = units.get(name, "_".join(words[1:])).lower()
    missing = [name for name in _PLACES if name not in columns]
    levels = [name for name in columns if name in _LEVELS]
    if missing or not levels:
        missing += [] if levels else ["one of " + ", ".join(_LEVELS)]
        raise InputError(f"{path}: line 1: no column of {', '.join(missing)} in {header}")
    for name in levels[1:]:
        del columns[name]
    for name in columns:
        _, known = _COLUMNS[name]
        if unit_of[name] not in known:
            had = f"unit {unit_of[name]!r}" if unit_of[name] else "no unit"
            raise InputError(
                f"{path}: line 1: {header[columns[name]]!r} has {had}; name it in the header or "
                f"give --unit {name}=UNIT, one of {', '.join(filter(None, known))}"
            )
    return columns, unit_of


def _numbers(rows: Iterable[list[str]], columns: Mapping[str, int], *, comma: bool) -> Real:
    """Return the numbers of those columns, (k, len(columns)), NaN for what is none."""

    def number(row: list[str], name: str) -> float:
        text = row[columns[name]].strip() if columns[name] < len(row) else ""
        with suppress(ValueError):
            return float(text.replace(",", ".") if comma else text)
        with suppress(ValueError):
            return datetime.fromisoformat(text).timestamp() if name == "time" else math.nan
        return math.nan

    found = [[number(row, name) for name in columns] for row in rows]
    return np.array(found, dtype=np.float64).reshape(-1, len(columns))
