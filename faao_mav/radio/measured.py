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
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    between = max(";\t,", key="".join(lines[:1]).count)
    if between == ";":
        lines[1:] = [line.replace(",", ".") for line in lines[1:]]
    rows = csv.reader(lines, delimiter=between)
    try:
        return measured_in(path, next(rows, []), rows, station, units, calibration)
    except csv.Error as error:
        raise InputError(f"{path}: {error}; expected rows of numbers") from None


def measured_in(
    path: Path,
    header: Sequence[str],
    rows: Iterable[Sequence[str | float]],
    station: Sequence[float],
    units: Mapping[str, str],
    calibration: Calibration,
) -> Measured:
    """Return the flight in `rows` under a `header`, of the log `path`; see `read_measured`."""
    columns, unit_of = _columns(path, header, units)
    numbers = [[_number(row, k, name) for name, k in columns.items()] for row in rows]
    found = np.array(numbers, dtype=np.float64).reshape(-1, len(columns))
    sound = np.isfinite(found).all(axis=1)
    if not sound.any():
        raise InputError(f"{path}: no row with {', '.join(columns)}; expected the rows of a flight")
    scales = [_COLUMNS[name][1][unit_of[name]] for name in columns]
    kept = dict(zip(columns, (found[sound] * scales).T, strict=True))
    t, latitude, longitude, altitude = (kept.pop(name) for name in _PLACES)
    ((name, told),) = kept.items()
    level, unit = _level(path, told, unit_of[name], calibration)
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
    samples = Samples(t[order], place[order], level[order], path.name)
    return Measured(samples, unit, int(np.sum(~sound)))


def _level(path: Path, told: Real, unit: str, calibration: Calibration) -> tuple[Real, str]:
    """Return levels `told` (k,) in `unit` as those of a `Measured`, and their unit.

    Counts are linear in dBm through the points of the `calibration`; with one point, or none, they
    have the steps, or all, of SiK radios.
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


def _columns(
    path: Path, header: Sequence[str], units: Mapping[str, str]
) -> tuple[dict[str, int], dict[str, str]]:
    """Return by quantity its column in `header`, and its unit; of several levels the first."""
    columns, unit_of = dict[str, int](), dict[str, str]()
    for number, told in enumerate(header):
        words = re.findall(r"[^\s_()\[\],]+", told.lower())
        name = _CALLED.get(words[0]) if words else None
        if name is None or not columns.keys().isdisjoint(_LEVELS if name in _LEVELS else [name]):
            continue
        unit, known = units.get(name, "_".join(words[1:])).lower(), _COLUMNS[name][1]
        if unit not in known:
            raise InputError(
                f"{path}: line 1: {told!r} has {f'unit {unit!r}' if unit else 'no unit'}; name it "
                f"in the header or give --unit {name}=UNIT, one of {', '.join(filter(None, known))}"
            )
        columns[name], unit_of[name] = number, unit
    missing = [name for name in _PLACES if name not in columns]
    missing += ["one of " + ", ".join(_LEVELS)] * columns.keys().isdisjoint(_LEVELS)
    if missing:
        raise InputError(f"{path}: line 1: no column of {', '.join(missing)} in {header}")
    return columns, unit_of


def _number(row: Sequence[str | float], column: int, name: str) -> float:
    """Return the number of that column, a quantity; NaN for what is none."""
    with suppress(ValueError, IndexError):
        return float(row[column])
    with suppress(ValueError, IndexError):
        if name == "time":
            return datetime.fromisoformat(str(row[column]).strip()).timestamp()
    return math.nan
