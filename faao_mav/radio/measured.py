"""Levels of a link that were measured in flight: tables of them (CSV), their columns and units."""

import csv
import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from types import MappingProxyType

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InputError, printable
from faao_mav.files import read_text, table
from faao_mav.geodesy import LocalFrame
from faao_mav.radio.fit import Samples
from faao_mav.radio.rate_steps import RateSteps

_MOST_BYTES = 200_000_000
"""Bytes of a table that are read at most; chosen: a day of ten rows a second."""

_FARTHEST, _SLOWEST = 100_000.0, 60.0
"""Metres from the station beyond which a position is mistaken, as one without a fix; seconds from
row to row beyond which they are of another unit. Chosen."""

_COLUMNS = {
    row["column"]: (
        row["called"].split(),
        dict(x.partition("=")[::2] for x in row["units"].split()),
    )
    for row in table("radio/levels.tsv")
}
"""What a header may call the columns, four of time and place and then levels, and their units, with
how many s, degrees, m, dBm, dB or Mbit/s one is, where it is not 1. `sik` is what SiK radios count,
`raw` is any other device's count."""

SIK_STEP, _SIK_AT_ZERO = 1.0 / 1.9, -127.0
"""dB a count of a SiK radio, and dBm that it counts as 0 (ArduPilot, "SiK Radio: Advanced
Configuration", which calls it approximate)."""

_SOUND = {"dbm": (-200.0, 60.0), "db": (-60.0, 120.0)}
"""The least and the greatest level of a unit; a row beyond them tells none, a table has another."""


def read_measured(
    path: str | Path,
    station: Sequence[float],
    units: Mapping[str, str] = MappingProxyType({}),
    calibration: Sequence[Sequence[float]] = (),
    rates: RateSteps | None = None,
    rows: Sequence[Sequence[str | float]] = (),
) -> Samples:
    r"""Return the flight in the table `path`: time, latitude, longitude, altitude and one level.

    Levels are rsrp, rssi, snr or throughput. `station` is latitude and longitude, degrees, and
    height, m, of the antenna of the station, above what the altitudes are above. `units` are those
    of columns whose header does not tell them; `calibration` are one or two counts of a device, and
    the dBm that they are. A throughput is told as the middle of the SNRs at which the radio has it
    by its `rates`, Mbit/s. `rows`, the first a header, are those of a log, which is no table. Rows
    that tell no place or level, as at the greatest rate, are left out. Raises `InputError` for
    what is no flight.

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
    header, *rows = rows or _rows(path)
    columns = _columns(path, [*map(str, header)], units)
    found = np.array([[_number(row, k, name) for row in rows] for k, name, _ in columns])
    found *= [[float(_COLUMNS[name][1].get(unit) or 1.0)] for _, name, unit in columns]
    found[4], unit = _level(path, found[4], columns[4][2], calibration, rates)
    sound = np.isfinite(found).all(axis=0)
    if not sound.any():
        names = ", ".join(name for _, name, _ in columns)
        told = ", between the least and the greatest of --rates" if rates else ""
        raise InputError(f"{path}: no row with {names}{told}; expected the rows of a flight")
    t, latitude, longitude, altitude, level = found[:, sound]
    (least, most), middle = _SOUND[unit], float(np.median(level))
    if not least <= middle <= most:
        text = f"levels about {middle:g} {unit}; expected {least:g} to {most:g}: is that the unit?"
        raise InputError(f"{path}: {text}")
    if (step := float(np.median(np.diff(t, prepend=t[0])))) > _SLOWEST:
        raise InputError(f"{path}: {step:g} s from row to row; give the unit, as --unit time=ms")
    local = LocalFrame(station[0], station[1]).to_local(latitude, longitude)
    away = float(np.median(np.hypot(*local.T)))
    if not away < _FARTHEST:
        raise InputError(
            f"{path}: {away / 1000:,.0f} km from --station {station[0]:g},{station[1]:g}; expected "
            "a flight about it: are latitude and longitude exchanged?"
        )
    place = np.column_stack([local, altitude - station[2]])
    kept = (least <= level) & (level <= most) & (np.linalg.norm(place, axis=1) < _FARTHEST)
    left_out, name = len(sound) - int(np.sum(kept)), printable(path.name)
    return Samples(t[kept], place[kept], level[kept], name, unit, left_out)


def _rows(path: Path) -> list[list[str]]:
    """Return the rows of the table `path`, the first its header."""
    text = read_text(path, _MOST_BYTES, "a table of measured levels", InputError)
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    between = max(";\t,", key=lines[0].count) if lines else ","
    if between == ";":
        lines[1:] = [line.replace(",", ".") for line in lines[1:]]
    try:
        return [*csv.reader(lines, delimiter=between)] or [[]]
    except csv.Error as error:
        raise InputError(f"{path}: {error}; expected rows of numbers") from None


def _level(
    path: Path,
    told: Real,
    unit: str,
    calibration: Sequence[Sequence[float]],
    rates: RateSteps | None,
) -> tuple[Real, str]:
    """Return levels `told` (k,) in `unit` as dBm or as an SNR, dB, and which of them.

    Counts are linear in dBm through the points of the `calibration`; with one point, or none, they
    have the steps, or all, of SiK radios.
    """
    if unit in _SOUND:
        return told, unit
    if unit not in ("sik", "raw"):
        if rates is None or not rates.rates:
            raise InputError(f"{path}: a throughput; give --rates, the radio's, some above 0")
        told = np.where(told < rates.most, told, np.nan)
        middle = np.add(rates.snr_db, np.diff(rates.snr_db, append=rates.snr_db[-1]) / 2)
        return np.interp(told, rates.rates, middle, left=np.nan), "db"
    if unit == "raw" and len(calibration) < 2:
        raise InputError(
            f"{path}: a device's own counts; expected two of them in dBm by --calibrate "
            "COUNT=DBM, or --unit rssi=sik, the counts of SiK radios"
        )
    (count, dbm), *more = calibration or [(0.0, _SIK_AT_ZERO)]
    slope = (more[0][1] - dbm) / (more[0][0] - count) if more else SIK_STEP
    return dbm + slope * (told - count), "dbm"


def _columns(
    path: Path, header: Sequence[str], units: Mapping[str, str]
) -> list[tuple[int, str, str]]:
    """Return the columns of time, place and the first level in `header`: number, name and unit."""
    if unknown := units.keys() - _COLUMNS.keys():
        text = f"--unit {min(unknown)}: no such column; give one of {', '.join(_COLUMNS)}"
        raise InputError(text)
    called = {word: name for name, (words, _) in _COLUMNS.items() for word in words}
    places, levels = [*_COLUMNS][:4], "one of " + ", ".join([*_COLUMNS][4:])
    found: dict[str, tuple[int, str, str]] = {}
    for number, told in enumerate(header):
        first, *rest = re.findall(r"[^\s_()\[\],]+", told.lower()) or [""]
        name = called.get(first, "")
        what = name if name in places else levels
        if not name or what in found:
            continue
        unit, known = units.get(name, "_".join(rest)).lower(), _COLUMNS[name][1]
        by_itself = name in places[:3] and name not in units  # seconds and degrees
        if unit not in known and (unit or not by_itself):
            raise InputError(
                f"{path}: line 1: {told!r} has {f'unit {unit!r}' if unit else 'no unit'}; name it "
                f"in the header or give --unit {name}=UNIT, one of {', '.join(known)}"
            )
        found[what] = number, name, unit
    if missing := [what for what in (*places, levels) if what not in found]:
        raise InputError(f"{path}: line 1: no column of {', '.join(missing)} in {header}")
    return [found[what] for what in (*places, levels)]


def _number(row: Sequence[str | float], column: int, name: str) -> float:
    """Return the number in that column, of times also that of a date; NaN for what is none."""
    with suppress(ValueError, IndexError):
        return float(row[column])
    with suppress(ValueError, IndexError):
        if name == "time":
            return datetime.fromisoformat(str(row[column]).strip()).timestamp()
    return math.nan
