"""Files of gain maps: NumPy archives (.npz), tables (.csv) and rasters, read without trust.

Rasters over the ground are GeoTIFF, of any map projection, and heights as .hgt (SRTM).

A plan's text holds its maps as one word each, so that it stands without their files: the archive,
of seven digits, in base64.
"""

import base64
import io
import math
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InputError, check_extra
from faao_mav.files import read_archive, read_bytes, read_columns, read_text, unpacked
from faao_mav.geodesy import LocalFrame
from faao_mav.radio.gain_map import GainMap

if TYPE_CHECKING:
    from pyproj import Transformer

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
_WHAT = f"a map with east, north and {_GAIN} or {_ABOVE}"

_DB = (-300.0, 100.0, "dB, NaN where no aircraft can be")
_PLACES = (-100_000.0, 100_000.0, "m")
"""Least and greatest dB, as a law's, and places and heights, as a plan's positions."""

_UNEVEN = 0.01
"""The share of a step by which a point of a grid may be off its even place: of rounded tables."""

_SAME = 6
"""Decimals of the metres by which rows of a table are at one place: the micrometre."""

_MAX_RASTER = 400_000_000
"""Bytes of the largest raster that is read. Chosen."""

_TILE = re.compile(r"[NS][0-9]{2}[EW][0-9]{3}", re.IGNORECASE)
"""How the name of a tile of heights begins: its south-west corner, degrees. GDAL would read others
than such numbers as 0."""


def read_map(path: str | Path) -> GainMap:
    """Return the map in the file `path`, .npz, .csv, .tif or .tiff.

    Raises `InputError` that names the file, the key or the place, and what would be accepted.
    """
    match Path(path).suffix.lower():
        case ".npz":
            return _checked(read_archive(path, _KEYS, _WHAT), path)
        case ".csv":
            return _checked(_table(path), path)
        case ".tif" | ".tiff":
            found = read_raster(path, "a map in GeoTIFF", MAX_VALUES).local()
            return _checked(dict(zip(("east", "north", _GAIN, "origin"), found, strict=True)), path)
    raise InputError(f"{path}: expected a map in a file that ends in .npz, .csv, .tif or .tiff")


def map_archive(found: GainMap, kind: type[np.floating[Any]] = np.float64) -> bytes:
    """Return the content of a file .npz with a map, dB and ground as numbers of a `kind`."""
    arrays: dict[str, Any] = {"east": found.east, "north": found.north, "height": found.heights}
    arrays[_ABOVE if found.above_law else _GAIN] = found.db.astype(kind)
    if found.ground is not None:
        arrays["ground"] = found.ground.astype(kind)
    if found.origin:
        arrays["origin"] = np.array(found.origin)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def map_word(found: GainMap) -> str:
    """Return a map as one word of a plan's text."""
    return WORD + base64.b64encode(map_archive(found, np.float32)).decode()


@lru_cache(maxsize=16)
def map_of_word(word: str, origin: tuple[float, float, float] | None = None) -> GainMap:
    """Return the map that `map_word` wrote, about the `origin` of the plan.

    Raises `InputError` for any other word, and for a map that is too far off.
    """
    try:
        content = base64.b64decode(word[len(WORD) :], validate=True)
        arrays = unpacked(io.BytesIO(content), _KEYS)
    except Exception as error:  # as of an archive
        raise InputError("not the numbers of a map; expected the name of a file") from error
    read = _checked(arrays, "the map")
    return read if origin is None else read.about(*origin)


def _checked(arrays: Mapping[str, Any], path: str | Path) -> GainMap:
    """Return the map of `arrays`. Raises `InputError` for what is none."""
    kinds = [key for key in (_GAIN, _ABOVE) if key in arrays]
    if len(kinds) != 1 or not {"east", "north"} <= arrays.keys():
        raise InputError(
            f"{path}: {', '.join(sorted(arrays)) or 'nothing'} in it; expected {_WHAT}"
        )
    kind, arrays = kinds[0], {"height": np.zeros(1)} | dict(arrays)
    j, m, k = (np.size(arrays[key]) for key in ("height", "north", "east"))
    shapes = {"height": (j,), "north": (m,), "east": (k,), "ground": (m, k), kind: (j, m, k)}
    shapes["origin"] = (3,) if np.size(arrays.get("origin", 0)) == 3 else (2,)
    held: dict[str, Real] = {}
    for key, values in arrays.items():
        least, most, unit = _DB if key == kind else _PLACES
        values = values[None] if key == kind and values.ndim == 2 else values
        numbers = values.dtype.kind in "iuf" and values.size <= MAX_VALUES
        if not numbers or values.shape != shapes[key]:
            had, due = (" x ".join(map(str, each)) for each in (values.shape, shapes[key]))
            order = " (height, north, east)" if key == kind else ""
            told = f"{had or 'one'} of {values.dtype}; expected {due} numbers{order}"
            raise InputError(f"{path}: {key}: {told}, at most {MAX_VALUES:,}")
        sound = (values >= least) & (values <= most) | np.isnan(values) & (key == kind)
        if not sound.all():
            told = f"{values[~sound][0]:g}; expected {least:g} to {most:g} {unit}"
            raise InputError(f"{path}: {key}: {told}")
        held[key] = values.astype(np.float64)
    for key in ("east", "north", "height"):
        held[key] = _rising(held[key], f"{path}: {key}", even=key != "height")
    origin = tuple(held.get("origin", np.empty(0)).tolist())
    if origin and (abs(origin[0]) > 90 or abs(origin[1]) > 180):
        told = "latitude and longitude, degrees, and for heights the elevation, m"
        raise InputError(f"{path}: origin: {list(origin)}; expected {told}")
    sides = held["east"], held["north"], held["height"]
    return GainMap(*sides, held[kind], kind == _ABOVE, held.get("ground"), origin)


def _rising(side: Real, key: str, *, even: bool) -> Real:
    """Return the numbers of a `side`, which rise, on the `even` grid that they are near."""
    due = np.linspace(side[0], side[-1], len(side)) if even and len(side) > 1 else side
    steps = np.diff(due)
    off = np.abs(side - due)[1:] > _UNEVEN * steps
    if (off | (steps <= 0)).any() or len(side) < 1 + even:
        ends = f"{len(side)} numbers" + (f" from {side[0]:g} to {side[-1]:g}" if len(side) else "")
        at = "" if not off.any() else f", among them {side[1:][off][0]:.10g}"
        what = "at least two, which rise by even steps" if even else "numbers that rise"
        raise InputError(f"{key}: {ends}{at}; expected {what}, m")
    return due


def _table(path: str | Path) -> dict[str, Real]:
    """Return the arrays of a table: a row for each point of the grid, in any order."""
    text = read_text(path, _MAX_CHARACTERS, "a table of a map", InputError)
    choices = tuple(("east_m", "north_m", kind) for kind in (_GAIN, _ABOVE))
    try:
        _, lists = read_columns(text, choices, ("height_m", "ground_m"))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    columns = {name: np.array(values) for name, values in lists.items()}
    names, rows = ("height_m", "north_m", "east_m"), len(columns["east_m"])
    with np.errstate(over="ignore"):  # such places are refused with the others that are far off
        places = [columns.get(name, np.zeros(rows)).round(_SAME) for name in names]
    sides, at = zip(*(np.unique(place, return_inverse=True) for place in places), strict=True)
    shape = tuple(map(len, sides))
    if math.prod(shape) > MAX_VALUES:
        counts = f"{rows:,} rows at {' x '.join(map(str, shape))} heights, north, east"
        raise InputError(f"{path}: {counts}; expected a grid of at most {MAX_VALUES:,} points")
    point = np.ravel_multi_index(at, shape)
    count = np.bincount(point, minlength=math.prod(shape))
    if (wrong := np.flatnonzero(count != 1)).size:
        place = zip(names, sides, np.unravel_index(wrong[0], shape), strict=True)
        where = ", ".join(f"{name} {side[i]:g}" for name, side, i in place if name in columns)
        raise InputError(
            f"{path}: {count[wrong[0]]} rows at {where}; expected one for each point of a grid"
        )
    gridded = {name: column[np.argsort(point)].reshape(shape) for name, column in columns.items()}
    arrays = {name.removesuffix("_m"): side for name, side in zip(names, sides, strict=True)}
    if "ground_m" in columns:
        ground = gridded["ground_m"]
        if np.ptp(ground, axis=0).any():
            raise InputError(f"{path}: ground_m: differs between heights; expected one at a place")
        arrays["ground"] = ground[0]
    return arrays | {kind: gridded[kind] for kind in (_GAIN, _ABOVE) if kind in columns}


@dataclass(frozen=True, eq=False)
class Raster:
    """`values` (m, k), NaN where they are not known, of cells over the ground.

    `from_degrees` tells coordinates from longitude and latitude, and `to_cell` (3, 3) column, row
    and 1 from coordinates and 1.
    """

    values: Real
    to_cell: Real
    from_degrees: "Transformer"

    def place(self, row: Real, column: Real) -> tuple[Real, Real]:
        """Return latitudes and longitudes (...), degrees, from the middle of the first cell on."""
        x, y, _ = np.linalg.solve(self.to_cell, [column + 0.5, row + 0.5, np.ones_like(row)])
        longitude, latitude = self.from_degrees.transform(x, y, direction="INVERSE")
        return latitude, longitude

    @property
    def step(self) -> float:
        """Metres from middle to middle, along rows or columns, whichever are less."""
        rows, columns = np.array(self.values.shape) / 2 - 0.5
        latitude, longitude = self.place(rows + np.array([0, 1, 0]), columns + np.array([0, 0, 1]))
        local = LocalFrame(latitude[0], longitude[0]).to_local(latitude, longitude)
        return float(np.hypot(*local[1:].T).min())

    def at(self, latitude: Real, longitude: Real) -> Real:
        """Return the values at places (...), bilinear between middles; NaN off the raster."""
        from scipy.ndimage import map_coordinates

        x, y = self.from_degrees.transform(longitude, latitude)
        rows, columns = self.values.shape
        if (crs := self.from_degrees.target_crs) and crs.is_geographic:  # across 180, from 0 to 360
            middle = np.linalg.solve(self.to_cell, [columns / 2, rows / 2, 1])[0]
            x = middle + np.remainder(x - middle + 180, 360) - 180
        column, row, _ = np.tensordot(self.to_cell, [x, y, np.ones_like(x)], 1) - 0.5
        on = (np.abs(2 * row - rows + 1) <= rows) & (np.abs(2 * column - columns + 1) <= columns)
        at = np.where(on, row, 0.0), np.where(on, column, 0.0)
        found = map_coordinates(self.values, at, order=1, mode="nearest")
        return np.where(on, found, np.nan)

    def local(self) -> tuple[Real, Real, Real, Real]:
        """Return the raster over local metres about its middle, as many steps each way.

        That is east (k,), north (m,), values (m, k), latitude and longitude of the middle.
        """
        rows, columns = self.values.shape
        middle = self.place(np.array((rows - 1) / 2), np.array((columns - 1) / 2))
        frame = LocalFrame(*map(float, middle))
        corners = np.array([0.0, 0.0, rows - 1, rows - 1]), np.array([0.0, columns - 1] * 2)
        x, y = frame.to_local(*self.place(*corners)).T
        east, north = np.linspace(x.min(), x.max(), columns), np.linspace(y.min(), y.max(), rows)
        grid = np.stack(np.meshgrid(east, north), axis=-1)
        return east, north, self.at(*frame.to_geodetic(grid)), np.array(frame.to_geodetic([0, 0]))


def read_raster(path: str | Path, what: str, most: int) -> Raster:
    """Return the raster in the file `path`, .hgt, .tif or .tiff, of at most so many cells.

    Raises `InputError` for anything else; `what` says what was expected.
    """
    content, path = read_bytes(path, _MAX_RASTER, what), Path(path)
    driver = "SRTMHGT" if path.suffix.lower() == ".hgt" else "GTiff"
    corner = _TILE.match(path.name)
    check_extra("maps", "rasterio", f"{path}, a raster,")
    import rasterio
    from pyproj import CRS, Transformer

    try:
        with (
            warnings.catch_warnings(action="ignore"),  # of rasters without a place: told below
            rasterio.MemoryFile(content, filename=f"{corner[0] if corner else ''}.hgt") as file,
            file.open(driver=driver) as data,
        ):
            if data.count != 1 or not data.crs or data.width * data.height > most:
                raise InputError(
                    f"{path}: {data.count} bands, {data.width} x {data.height} cells, "
                    f"{data.crs or 'no coordinates'}; expected {what}: one band, at most {most:,} "
                    "cells, coordinates"
                )
            values = data.read(1, masked=True).astype(np.float64).filled(np.nan)
            values = values * data.scales[0] + data.offsets[0]
            to_cell = np.linalg.inv(np.reshape([*data.transform], (3, 3)))
            crs = CRS.from_wkt(data.crs.to_wkt())
            from_degrees = Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    except InputError:
        raise
    except Exception as error:  # rasterio and GDAL raise several kinds
        raise InputError(f"{path}: cannot be read as {what}") from error

    return Raster(values, to_cell, from_degrees)
