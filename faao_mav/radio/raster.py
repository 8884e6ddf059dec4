"""Rasters over the ground, of any map projection: GeoTIFF, and heights as .hgt (SRTM)."""

import math
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InputError, check_extra
from faao_mav.files import read_bytes
from faao_mav.geodesy import LocalFrame

_MAX_BYTES = 400_000_000
"""Bytes of the largest file that is read. Chosen."""

_TILE = re.compile(r"([NS])(\d\d)([EW])(\d{3})", re.IGNORECASE)
"""How the name of a tile of heights begins: its south-west corner, degrees."""

_SIDES = (1201, 3601)
"""Rows and columns of such a tile, by 3 or 1 seconds of arc."""


@dataclass(frozen=True, eq=False)
class Raster:
    """`values` (m, k), NaN where they are not known, at the middles of cells.

    `cell` tells row and column of longitudes and latitudes, degrees, `place` the reverse.
    """

    values: Real
    cell: Callable[[Real, Real], tuple[Real, Real]]
    place: Callable[[Real, Real], tuple[Real, Real]]

    @property
    def step(self) -> float:
        """Metres from middle to middle, along rows or columns, whichever are less."""
        rows, columns = np.array(self.values.shape) / 2 - 0.5
        at = rows + np.array([0.0, 1.0, 0.0]), columns + np.array([0.0, 0.0, 1.0])
        longitude, latitude = self.place(*at)
        local = LocalFrame(latitude[0], longitude[0]).to_local(latitude, longitude)
        return float(np.hypot(*local[1:].T).min())

    def at(self, latitude: Real, longitude: Real) -> Real:
        """Return the values at places (...), bilinear between middles; NaN off the raster."""
        from scipy.ndimage import map_coordinates

        row, column = self.cell(longitude, latitude)
        rows, columns = self.values.shape
        on = (np.abs(2 * row - rows + 1) <= rows) & (np.abs(2 * column - columns + 1) <= columns)
        at = np.where(on, row, 0.0), np.where(on, column, 0.0)
        found = map_coordinates(self.values, at, order=1, mode="nearest")
        return np.where(on, found, np.nan)

    def local(self) -> tuple[Real, Real, Real, Real]:
        """Return the raster over local metres about its middle, as many steps each way.

        That is east (k,), north (m,), values (m, k), latitude and longitude of the middle.
        """
        rows, columns = self.values.shape
        longitude, latitude = self.place(np.array((rows - 1) / 2), np.array((columns - 1) / 2))
        frame = LocalFrame(float(latitude), float(longitude))
        corners = np.array([0.0, 0.0, rows - 1, rows - 1]), np.array([0.0, columns - 1] * 2)
        x, y = frame.to_local(*self.place(*corners)[::-1]).T
        east, north = np.linspace(x.min(), x.max(), columns), np.linspace(y.min(), y.max(), rows)
        grid = np.stack(np.meshgrid(east, north), axis=-1)
        middle = np.array([frame.latitude, frame.longitude])
        return east, north, self.at(*frame.to_geodetic(grid)), middle


def read_raster(path: str | Path, what: str, most: int) -> Raster:
    """Return the raster in the file `path`, .hgt, .tif or .tiff, of at most so many cells.

    Raises `InputError` for anything else; `what` says what was expected.
    """
    content = read_bytes(path, _MAX_BYTES, what)
    if Path(path).suffix.lower() == ".hgt":
        return _tile(content, Path(path))
    check_extra("maps", "rasterio", f"{path}, a GeoTIFF,")
    import rasterio
    from pyproj import CRS, Transformer

    try:
        with (
            warnings.catch_warnings(action="ignore"),  # of rasters without a place: told below
            rasterio.MemoryFile(content) as file,
            file.open(driver="GTiff") as data,
        ):
            if data.count != 1 or not data.crs or data.width * data.height > most:
                raise InputError(
                    f"{path}: {data.count} bands, {data.width} x {data.height} cells, "
                    f"{data.crs or 'no coordinates'}; expected {what}: one band, at most {most:,} "
                    "cells, coordinates"
                )
            values = data.read(1, masked=True).astype(np.float64).filled(np.nan)
            forward = np.reshape([*data.transform], (3, 3))
            inverse = np.linalg.inv(forward)
            crs = CRS.from_wkt(data.crs.to_wkt())
            to_crs = Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    except InputError:
        raise
    except Exception as error:  # rasterio and GDAL raise several kinds
        raise InputError(f"{path}: cannot be read as {what}") from error

    def cell(longitude: Real, latitude: Real) -> tuple[Real, Real]:
        column, row = _affine(inverse, *to_crs.transform(longitude, latitude))
        return row - 0.5, column - 0.5

    def place(row: Real, column: Real) -> tuple[Real, Real]:
        x, y = _affine(forward, column + 0.5, row + 0.5)
        longitude, latitude = to_crs.transform(x, y, direction="INVERSE")
        return longitude, latitude

    return Raster(values, cell, place)


def _affine(matrix: Real, x: Real, y: Real) -> tuple[Real, Real]:
    (a, b, c), (d, e, f), _ = matrix
    return a * x + b * y + c, d * x + e * y + f


def _tile(content: bytes, path: Path) -> Raster:
    """Return a tile of heights, m: rows of 16 bits from the north, its corner in its name."""
    corner, side = _TILE.match(path.name), math.isqrt(len(content) // 2)
    if corner is None or side not in _SIDES or 2 * side**2 != len(content):
        raise InputError(
            f"{path}: {len(content):,} bytes; expected a tile of heights by 1 or 3 seconds of arc, "
            "named by its south-west corner, as N47E008.hgt"
        )
    south, west = (
        float(degrees) * (-1.0 if sign.upper() in "SW" else 1.0)
        for sign, degrees in (corner.groups()[:2], corner.groups()[2:])
    )
    heights = np.frombuffer(content, ">i2").reshape(side, side).astype(np.float64)
    heights[heights == -32768] = np.nan  # the format's void
    last = side - 1.0
    return Raster(
        heights,
        lambda longitude, latitude: (last * (south + 1 - latitude), last * (longitude - west)),
        lambda row, column: (west + column / last, south + 1 - row / last),
    )
