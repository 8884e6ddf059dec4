"""Levels of a link that were measured in flight: their units, and tables of them (CSV)."""

import csv
import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
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

_COLUMNS = {
    "time": ("time timestamp t seconds", "s sec seconds ms us"),
    "latitude": ("latitude lat", "deg degrees"),
    "longitude": ("longitude lon lng long", "deg degrees"),
    "altitude": ("altitude alt height", "m meters metres ft feet"),
    "rsrp": ("rsrp", "dbm"),
    "rssi": ("rssi power signal", "dbm sik raw"),
    "snr": ("snr sinr", "db"),
    "throughput": (
        "throughput rate goodput",
        "mbit/s mbps mbit_per_s kbit/s kbps kbit_per_s bit/s bps bit_per_s",
    ),
}
"""What a table's header may call its columns, of which the last four are levels, and their units.
`sik` is what SiK radios count, `raw` is any other device's count."""

_SCALES = {"ms": 1e-3, "us": 1e-6, "ft": 0.3048, "feet": 0.3048} | {
    f"{prefix}{unit}": scale
    for prefix, scale in (("k", 1e-3), ("", 1e-6))
    for unit in ("bit/s", "bps", "bit_per_s")
}
"""Those units in s, m and Mbit/s that are not 1; others are s, degrees, m, dB and Mbit/s."""

_PLACES, _LEVELS = tuple(_COLUMNS)[:4], tuple(_COLUMNS)[4:]

SIK_STEP, _SIK_AT_ZERO = 1.0 / 1.9, -127.0
"""dB a count of a SiK radio, and dBm that it counts as 0 (ArduPilot, "SiK Radio: Advanced
Configuration", which calls it approximate)."""

_SOUND = {"dbm": (-200.0, 60.0), "db": (-60.0, 120.0), "mbit/s": (-math.inf, math.inf)}
"""The least and the greatest level of a unit; beyond them it is another unit."""

Calibration: TypeAlias = Sequence[Sequence[float]]
"""Counts of a device, and the dBm that they are: one or two."""


def read_measured(
    path: str | Path,
    station: Sequence[float],
    units: Mapping[str, str] = MappingProxyType({}),
    calibration: Calibration = (),
) -> Samples:
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
    >>> found.unit, found.place.round().tolist(), found.level.tolist()
    ('dbm', [[0.0, 111.0, 50.0]], [-70.0])
    """
    path = Path(path)
    text = read_text(path, _MOST_BYTES, "a table of measured levels", InputError)
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")] or [
        ""
    ]
    between = max(";\t,", key=lines[0].count)
    if between == ";":
        lines[1:] = [line.replace(",", ".") for line in lines[1:]]
    try:
        header, *rows = csv.reader(lines, delimiter=between)
    except csv.Error as error:
        raise InputError(f"{path}: {error}; expected rows of numbers") from None
    return measured_in(path, header, rows, station, units, calibration)


def measured_in(
    path: Path,
    header: Sequence[str],
    rows: Sequence[Sequence[str | float]],
    station: Sequence[float],
    units: Mapping[str, str],
    calibration: Calibration,
) -> Samples:
    """Return the flight in `rows` under a `header`, of the log `path`; see `read_measured`."""
    columns = _columns(path, header, units)
    found = np.array([[_number(row, k, name) for row in rows] for name, (k, _) in columns.items()])
    sound = np.isfinite(found).all(axis=0)
    if not sound.any():
        raise InputError(f"{path}: no row with {', '.join(columns)}; expected the rows of a flight")
    kept = {
        name: _SCALES.get(unit, 1.0) * each[sound]
        for (name, (_, unit)), each in zip(columns.items(), found, strict=True)
    }
    t, latitude, longitude, altitude = (kept.pop(name) for name in _PLACES)
    ((name, told),) = kept.items()
    level, unit = _level(path, told, columns[name][1], calibration)
    if np.abs(latitude).max() > 90.0 or np.abs(longitude).max() > 360.0:
        raise InputError(f"{path}: a latitude beyond 90 or a longitude beyond 360 degrees")
    local = LocalFrame(station[0], station[1]).to_local(latitude, longitude)
    away = float(np.median(np.hypot(*local.T)))
    if not away < _FARTHEST:
        raise InputError(
            f"{path}: {away / 1000:,.0f} km from --station {station[0]:g},{station[1]:g}; expected "
            "a flight about it: are latitude and longitude exchanged?"
        )
    place = np.column_stack([local, altitude - station[2]])
    return Samples(t, place, level, path.name, unit, int(np.sum(~sound)))


def _level(path: Path, told: Real, unit: str, calibration: Calibration) -> tuple[Real, str]:
    """Return levels `told` (k,) in `unit` as those of `Samples`, and their unit.

    Counts are linear in dBm through the points of the `calibration`; with one point, or none, they
    have the steps, or all, of SiK radios.
    """
    if unit in ("sik", "raw"):
        if unit == "raw" and len(calibration) < 2:
            raise InputError(
                f"{path}: a device's own counts; expected two of them in dBm by --calibrate "
                "COUNT=DBM, or --unit rssi=sik, the counts of SiK radios"
            )
        (count, dbm), *more = calibration or [(0.0, _SIK_AT_ZERO)]
        slope = (more[0][1] - dbm) / (more[0][0] - count) if more else SIK_STEP
        told, unit = dbm + slope * (told - count), "dbm"
    unit = unit if unit in _SOUND else "mbit/s"
    (least, most), middle = _SOUND[unit], float(np.median(told))
    if not least <= middle <= most:
        text = f"levels about {middle:g} {unit}; expected {least:g} to {most:g}: is that the unit?"
        raise InputError(f"{path}: {text}")
    return told, unit


def _columns(
    path: Path, header: Sequence[str], units: Mapping[str, str]
) -> dict[str, tuple[int, str]]:
    """Return by quantity its column in `header`, and its unit; of several levels the first."""
    if unknown := units.keys() - _COLUMNS.keys():
        text = f"--unit {min(unknown)}: no such column; give one of {', '.join(_COLUMNS)}"
        raise InputError(text)
    called = {word: name for name, (words, _) in _COLUMNS.items() for word in words.split()}
    found: dict[str, tuple[int, str]] = {}
    for number, told in enumerate(header):
        first, *rest = re.findall(r"[^\s_()\[\],]+", told.lower()) or [""]
        name = called.get(first)
        if name is None or not found.keys().isdisjoint(_LEVELS if name in _LEVELS else [name]):
            continue
        unit, known = units.get(name, "_".join(rest)).lower(), _COLUMNS[name][1].split()
        if unit not in known and (unit or name not in _PLACES[:3]):  # seconds and degrees
            raise InputError(
                f"{path}: line 1: {told!r} has {f'unit {unit!r}' if unit else 'no unit'}; name it "
                f"in the header or give --unit {name}=UNIT, one of {', '.join(known)}"
            )
        found[name] = number, unit
    missing = [name for name in _PLACES if name not in found]
    missing += ["one of " + ", ".join(_LEVELS)] * found.keys().isdisjoint(_LEVELS)
    if missing:
        raise InputError(f"{path}: line 1: no column of {', '.join(missing)} in {header}")
    return found


def _number(row: Sequence[str | float], column: int, name: str) -> float:
    """Return the number of that column, a quantity; NaN for what is none."""
    with suppress(ValueError, IndexError):
        return float(row[column])
    with suppress(ValueError, IndexError):
        if name == "time":
            return datetime.fromisoformat(str(row[column]).strip()).timestamp()
    return math.nan
