"""What terrain takes of a link: diffraction by Recommendation ITU-R P.526-15, as a map.

Along the profile between both antennas the edges that they see highest stand for one, that of
Bullington's construction (section 4.5.1), whose loss is that of a knife edge (4.1), with the
recommendation's term for terrain that is no single edge. The earth has 4/3 of its radius.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame
from faao_mav.radio.gain_map import GainMap, Grid, filled
from faao_mav.radio.map_file import MAX_VALUES, Raster, read_raster

_LIGHT = 299_792_458.0
"""The speed of light, m/s."""

_EARTH = 8.5e6
"""The effective radius of the earth, m, in a standard atmosphere (P.526, section 2)."""

_MOST_HEIGHTS, _MOST_CELLS = 25_000_000, 2000
"""Heights of the largest file, two tiles by a second of arc (200 MB), and points a side of the
terrain that profiles are taken from. Chosen."""


def free_space_db(frequency: float) -> float:
    """Return the gain of free space at 1 m between isotropic antennas, dB, at a frequency, Hz.

    >>> round(free_space_db(2.4e9), 2)
    -40.05
    """
    return 20 * math.log10(_LIGHT / (4 * math.pi * frequency))


def knife_edge_loss(nu: Real) -> Real:
    """Return J(nu), dB, of a knife edge, by P.526-15 (31); 0 up to nu = -0.78.

    >>> knife_edge_loss(np.array([-1.0, 0.0, 1.0, 2.4])).round(2).tolist()
    [0.0, 6.03, 13.93, 20.54]
    """
    x = np.maximum(nu, -0.78) - 0.1
    return np.where(nu > -0.78, 6.9 + 20 * np.log10(np.sqrt(x**2 + 1) + x), 0.0)


def diffraction_loss(
    distance: Real, share: Real, tops: Real, ends: tuple[Real | float, Real], wavelength: float
) -> Real:
    """Return the loss, dB (n,), of n profiles by P.526-15, 4.5.1.

    `distance` (n,) is between the antennas, whose heights `ends` are, m; terrain has heights `tops`
    (p, n), m, at the shares `share` (p, 1) of it from the first to the second.

    >>> share = np.linspace(0.1, 0.9, 9)[:, None]
    >>> tops = np.where(share == 0.5, 20.0, 0.0)
    >>> diffraction_loss(np.array([1e3]), share, tops, (10.0, np.array([10.0])), 0.125).round(1)
    array([30.7])
    """
    d, (first, last) = distance, ends
    over = tops + share * (1 - share) * d**2 / (2 * _EARTH)
    line = (1 - share) * first + share * last
    edge = (over - line) * np.sqrt(2 / (wavelength * d * share * (1 - share)))
    up = ((over - first) / (share * d)).max(axis=0)
    down = ((over - last) / ((1 - share) * d)).max(axis=0)
    seen = up <= (last - first) / d
    both = np.where(seen, 1.0, np.maximum(up + down, np.finfo(float).tiny))
    at = np.clip((last - first + down * d) / (both * d), share[0], share[-1])
    point = first + up * at * d - (first * (1 - at) + last * at)
    nu = np.where(seen, edge.max(axis=0), point * np.sqrt(2 / (wavelength * d * at * (1 - at))))
    loss = knife_edge_loss(nu)
    return np.asarray(loss + (1 - np.exp(-loss / 6)) * (10 + 2e-5 * d))


def terrain_map(
    rasters: Sequence[Raster],
    station: Sequence[float],
    frequency: float,
    heights: Sequence[float],
    clutter: float,
    radius: float,
    spacing: float,
    observe: Callable[[str, int, int], object] = lambda *_: None,
) -> GainMap:
    """Return minus the diffraction loss about a `station`, dB above free space, and the ground.

    `station` is latitude and longitude, degrees, and the height of its antenna above its ground, m;
    `frequency` is in Hz, `heights` of the aircraft, m, above the station's ground, which is the
    map's own origin. `clutter`, m, stands on the ground but for a step about the station. The map
    goes `radius` m each way by steps of `spacing`; `observe` hears how many of its rows are done.
    Raises `InputError` where the rasters do not cover the map, or for one that is too large.
    """
    latitude, longitude, mast = station
    count = 2 * math.ceil(radius / spacing) + 1
    if count**2 * len(heights) > MAX_VALUES:
        raise InputError(
            f"{len(heights)} heights of {count} x {count} points; expected at most {MAX_VALUES:,}: "
            "give --spacing or --radius"
        )
    side = np.linspace(-radius, radius, count)
    step = max(min(each.step for each in rasters) / 2, 2 * radius / _MOST_CELLS)
    fine = np.linspace(-radius, radius, math.ceil(2 * radius / step) + 1)
    places = LocalFrame(latitude, longitude).to_geodetic(np.stack(np.meshgrid(fine, fine), -1))
    found = np.full(places[0].shape, np.nan)
    for each in rasters:
        found = np.where(np.isnan(found), each.at(*places), found)
    if np.isnan(found).any():
        lost = [float(degrees[np.isnan(found)][0]) for degrees in places]
        raise InputError(
            f"--terrain: no height at {lost[0]:.5f}, {lost[1]:.5f}; expected all of {radius:g} m "
            "each way of the station: give more files, or --radius"
        )
    terrain, wavelength = Grid.through(fine, fine, found.T), _LIGHT / frequency
    points = math.ceil(math.sqrt(2) * radius / step)
    share = np.arange(1.0, points + 1)[:, None] / (points + 1)
    own = terrain.value(np.zeros(1), np.zeros(1))[0]
    ground = terrain.value(*np.meshgrid(side, side)) - own + clutter
    db = np.empty((len(heights), count, count))
    for m, north in enumerate(side):
        distance = np.maximum(np.hypot(side, north), 1.0)
        tops = terrain.value(share * side, share * north) - own
        tops += clutter * (share * distance > step)
        for j, height in enumerate(heights):
            ends = mast, np.full(count, float(height))
            loss = diffraction_loss(distance, share, tops, ends, wavelength)
            db[j, m] = np.where(ground[m] >= height, np.nan, -loss)
        observe("terrain", m + 1, count)
    origin = float(latitude), float(longitude), float(own)
    return GainMap(side, side, np.array(heights), db, True, ground, origin)


def read_terrain(path: str | Path) -> tuple[Raster, int]:
    """Return the heights in a file, .hgt, .tif or .tiff, and how many were not known.

    Those are as at the nearest place that is. Raises `InputError` as `read_raster` does.
    """
    raster = read_raster(path, "heights in one band (.hgt named as N47E008.hgt)", _MOST_HEIGHTS)
    values = np.where((raster.values < -500) | (raster.values > 9000), np.nan, raster.values)
    unknown = np.isnan(values)
    if unknown.all():
        raise InputError(f"{path}: no heights of -500 to 9000 m")
    return replace(raster, values=filled(values)), int(unknown.sum())
