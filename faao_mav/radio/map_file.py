"""Files of gain maps: NumPy archives (.npz), tables (.csv) and GeoTIFF, read without trust.

A plan's text holds its maps as one word each, so that it stands without their files: the archive,
with decibels and metres in hundredths, in base64.
"""

import base64
import io
import math
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.errors import InputError, quote
from faao_mav.files import read_text
from faao_mav.radio.archive import read_archive, unpacked
from faao_mav.radio.columns import read_columns
from faao_mav.radio.gain_map import GainMap
from faao_mav.radio.raster import read_raster

MAX_VALUES = 1_000_000
"""Numbers of decibels in the largest map: a kilometre square by steps of a metre. Chosen."""

MAX_WORD = 16 * MAX_VALUES
"""Characters of a map in a plan's text at most: four bytes a number, twice, in base64 and more."""

WORD = "npz:"
"""What the word of a map in a plan's text begins with, which no file's name does."""

_MAX_CHARACTERS = 100 * MAX_VALUES
"""Bytes of the longest table that is read: six numbers of 16 digits a row."""

_GAIN, _ABOVE = "gain_db", "above_law_db"
_KEYS = ("east", "north", "height", _GAIN, _ABOVE, "ground", "origin")

_DB = (-300.0, 100.0)
"""Least and greatest dB of a map, as those of a law."""

_PLACES = (-100_000.0, 100_000.0)
"""Least and greatest places and heights, m, as a plan's positions have them."""

_UNEVEN = 0.01
"""The share of a step by which a point of a grid may be off its even place: of rounded tables."""

_SAME = 6
"""Decimals of the metres by which rows of a table are at one place: the micrometre."""

_NONE = np.iinfo(np.int32).min
"""What stands for NaN in a plan's text."""

_Arrays: TypeAlias = Mapping[str, Any]

_WHAT = f"a map of {', '.join(_KEYS[:3])} and {_GAIN} or {_ABOVE}"


def read_map(path: str | Path) -> GainMap:
    """Return the map in the file `path`, .npz, .csv, .tif or .tiff.

    Raises `InputError` that names the file, the key or the line, and what would be accepted.
    """
    match Path(path).suffix.lower():
        case ".npz":
            return _checked(read_archive(path, _KEYS, _WHAT), path)
        case ".csv":
            return _checked(_table(path), path)
        case ".tif" | ".tiff":
            raster = read_raster(path, "a map in GeoTIFF", MAX_VALUES)
            east, north, values, middle = raster.local()
            return _checked(
                {"east": east, "north": north, _GAIN: values, "origin": np.array(middle)}, path
            )
    raise InputError(f"{path}: expected a map in a file that ends in .npz, .csv, .tif or .tiff")


def map_archive(found: GainMap) -> bytes:
    """Return the content of a file .npz with a map."""
    return _packed(_arrays(found))


def map_word(found: GainMap) -> str:
    """Return a map as one word of a plan's text, its dB and its ground in hundredths."""
    arrays = _arrays(found)
    for key in _whole(arrays):
        arrays[key] = np.diff(_hundredths(arrays[key]), prepend=np.int32(0))
    return WORD + base64.b64encode(_packed(arrays)).decode()


@lru_cache(maxsize=16)
def map_of_word(word: str, origin: tuple[float, float, float] | None = None) -> GainMap:
    """Return the map that `map_word` wrote, about the `origin` of the plan.

    Raises `InputError` for any other word, and for a map that is too far off.
    """
    try:
        found = unpacked(io.BytesIO(base64.b64decode(word[len(WORD) :], validate=True)), _KEYS)
        arrays: dict[str, Any] = dict(found or {})
        for key in _whole(arrays):
            whole = np.cumsum(arrays[key].astype(np.int32, casting="safe"), -1, np.int32)
            arrays[key] = np.where(whole == _NONE, np.nan, whole / 100.0)
    except Exception as error:  # as of an archive
        raise InputError("not the numbers of a map; expected the name of a file") from error
    read = _checked(arrays, "the map")
    return read if origin is None else read.about(*origin)


def _arrays(found: GainMap) -> dict[str, Any]:
    arrays = {"east": found.east, "north": found.north, "height": found.heights}
    arrays[_ABOVE if found.above_law else _GAIN] = found.db
    if found.ground is not None:
        arrays["ground"] = found.ground
    if found.origin:
        arrays["origin"] = np.array(found.origin)
    return arrays


def _whole(arrays: _Arrays) -> set[str]:
    return {_GAIN, _ABOVE, "ground"}.intersection(arrays)


def _hundredths(values: Real) -> Integers:
    whole = np.where(np.isnan(values), _NONE, np.rint(100.0 * np.nan_to_num(values)))
    return whole.astype(np.int32)


def _packed(arrays: _Arrays) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def _checked(arrays: _Arrays, path: str | Path) -> GainMap:
    """Return the map of `arrays`. Raises `InputError` for what is none."""
    for key, values in arrays.items():
        if values.dtype.kind not in "iuf":
            raise InputError(f"{path}: {key}: {values.dtype}; expected numbers")
    kinds = [key for key in (_GAIN, _ABOVE) if key in arrays]
    for key in ("east", "north"):
        if key not in arrays:
            raise InputError(f"{path}: {key}: missing; expected {_WHAT}")
    if len(kinds) != 1:
        told = "both are given" if kinds else "missing"
        raise InputError(f"{path}: {_GAIN} or {_ABOVE}: {told}; expected one of them")
    db = np.asarray(arrays[kinds[0]], dtype=np.float64)
    if db.size > MAX_VALUES:
        raise InputError(
            f"{path}: {kinds[0]}: {db.size:,} numbers; expected at most {MAX_VALUES:,}"
        )
    db = db[None] if db.ndim < 3 else db
    east, north = (_even(arrays[key], f"{path}: {key}") for key in ("east", "north"))
    if "height" not in arrays and db.shape[0] > 1:
        raise InputError(f"{path}: height: missing; expected one for each of {kinds[0]}")
    heights = _line(arrays.get("height", np.zeros(1)), f"{path}: height", 1)
    shape = (len(heights), len(north), len(east))
    _fits(db, shape, *_DB, f"{path}: {kinds[0]}", "dB, NaN where no aircraft can be")
    ground = arrays.get("ground")
    if ground is not None:
        ground = np.asarray(ground, dtype=np.float64)
        _fits(ground, shape[1:], *_PLACES, f"{path}: ground", "m", known=True)
    origin = tuple(map(float, arrays.get("origin", np.empty(0)).ravel()))
    if origin and not (
        len(origin) in (2, 3)
        and all(map(math.isfinite, origin))
        and abs(origin[0]) <= 90
        and abs(origin[1]) <= 180
    ):
        raise InputError(
            f"{path}: origin: {quote(list(origin))}; expected latitude and longitude, degrees, and "
            "for heights the elevation, m"
        )
    return GainMap(east, north, heights, db, kinds[0] == _ABOVE, ground, origin)


def _fits(
    values: Real,
    shape: tuple[int, ...],
    least: float,
    most: float,
    key: str,
    unit: str,
    known: bool = False,
) -> None:
    """Raise `InputError` unless `values` have a `shape` and are within limits, or NaN."""
    if values.shape != shape:
        raise InputError(
            f"{key}: {' x '.join(map(str, values.shape))} numbers; expected "
            f"{' x '.join(map(str, shape))}, {'heights, ' if len(shape) > 2 else ''}north, east"
        )
    wrong = ~((values >= least) & (values <= most) | (np.isnan(values) & (not known)))
    if wrong.any():
        raise InputError(f"{key}: {values[wrong][0]:g}; expected {least:g} to {most:g} {unit}")


def _line(values: "np.ndarray[Any, Any]", key: str, fewest: int) -> Real:
    """Return `values` that rise, at least so many."""
    line = np.asarray(values, dtype=np.float64)
    if line.ndim != 1 or len(line) < fewest:
        shape = " x ".join(map(str, line.shape)) or "one"
        raise InputError(f"{key}: {shape} numbers; expected a list of at least {fewest}")
    _fits(line, line.shape, *_PLACES, key, "m", known=True)
    if (fall := np.flatnonzero(np.diff(line) <= 0)).size:
        at = int(fall[0])
        raise InputError(f"{key}: {line[at + 1]:g} after {line[at]:g}; expected metres that rise")
    return line


def _even(values: "np.ndarray[Any, Any]", key: str) -> Real:
    """Return the even grid of `values`, which are near it."""
    line = _line(values, key, 2)
    even = np.linspace(line[0], line[-1], len(line))
    step = float(even[1] - even[0])
    if (off := np.flatnonzero(np.abs(line - even) > _UNEVEN * step)).size:
        at = int(off[0])
        raise InputError(
            f"{key}: {line[at]:.10g}; expected even steps, which are {step:.6g} m: {even[at]:.10g}"
        )
    return even


def _table(path: str | Path) -> dict[str, Real]:
    """Return the arrays of a table: a row for each point of the grid, in any order."""
    text = read_text(path, _MAX_CHARACTERS, "a table of a map", InputError)
    choices = tuple(("east_m", "north_m", kind) for kind in (_GAIN, _ABOVE))
    try:
        lines, lists = read_columns(text, choices, ("height_m", "ground_m"))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    columns = {name: np.array(values) for name, values in lists.items()}
    if len(lines) > MAX_VALUES:
        raise InputError(f"{path}: {len(lines):,} rows; expected at most {MAX_VALUES:,}")
    sides, numbers = [], []
    for name in ("height_m", "north_m", "east_m"):
        column = columns.get(name, np.zeros(len(lines))).round(_SAME)
        if (wrong := np.flatnonzero(~np.isfinite(column))).size:
            told = f"{name}: {column[wrong[0]]:g}; expected metres"
            raise InputError(f"{path}: line {lines[wrong[0]]}: {told}")
        side, number = np.unique(column, return_inverse=True)
        sides.append(side)
        numbers.append(number)
    shape = tuple(map(len, sides))
    point = np.ravel_multi_index(numbers, shape)
    order = np.argsort(point, kind="stable")
    rest = point[order] - np.arange(len(point))  # below 0 after a place that stands twice
    if (off := np.flatnonzero(rest)).size and rest[off[0]] < 0:
        again, before = lines[order[off[0]]], lines[order[off[0] - 1]]
        raise InputError(f"{path}: line {again}: the place of line {before} again")
    if len(point) < math.prod(shape):
        absent = np.unravel_index(off[0] if off.size else len(point), shape)
        height, north, east = (side[i] for side, i in zip(sides, absent, strict=True))
        raise InputError(
            f"{path}: no row at height {height:g}, north {north:g}, east {east:g} m; expected one "
            "for each point of a grid"
        )
    kind = next(name for name in (_GAIN, _ABOVE) if name in columns)
    arrays = {"north": sides[1], "east": sides[2], kind: columns[kind][order].reshape(shape)}
    if "height_m" in columns:
        arrays["height"] = sides[0]
    if "ground_m" in columns:
        ground = columns["ground_m"][order].reshape(shape)
        if (ground != ground[:1]).any():
            raise InputError(f"{path}: ground_m: differs between heights; expected one at a place")
        arrays["ground"] = ground[0]
    return arrays
