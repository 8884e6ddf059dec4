"""Diffraction by ITU-R P.526 beside closed forms, and maps of it over made terrain."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import fresnel

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.radio.map_file import read_raster
from faao_mav.radio.terrain import diffraction_loss, knife_edge_loss, read_terrain, terrain_map

SHARE: Real = np.linspace(0.0, 1.0, 2001)[1:-1, None]
EARTH = 8.5e6
SOUTH, WEST = 47, 8
STATION = (47.5, 8.5, 10.0)


def whole(nu: float) -> float:
    """The loss of Bullington's one edge and the recommendation's term on it, on a short path."""
    j = float(knife_edge_loss(np.array(nu)))
    return float(j + (1 - np.exp(-j / 6)) * 10)


def loss(d: float, tops: Real, ends: tuple[float, float], wavelength: float) -> float:
    last = np.array([ends[1]])
    return float(diffraction_loss(np.array([d]), SHARE, tops, (ends[0], last), wavelength)[0])


def test_one_edge_is_itself_and_two_are_bullingtons() -> None:
    d, wavelength, h = 1000.0, 0.125, 12.0
    edge: Real = np.where(np.abs(SHARE - 0.5) < 1e-9, h, -50.0)
    bulge = d**2 / 8 / EARTH
    nu = (h + bulge) * np.sqrt(8 / (wavelength * d))
    assert loss(d, edge, (0.0, 0.0), wavelength) == pytest.approx(whole(nu), abs=0.03)
    two = np.where((np.abs(SHARE - 0.25) < 1e-9) | (np.abs(SHARE - 0.75) < 1e-9), h, -50.0)
    bulge = 3 * d**2 / 32 / EARTH
    nu = 2 * (h + bulge) * np.sqrt(8 / (wavelength * d))  # their lines meet in the middle
    assert loss(d, two, (0.0, 0.0), wavelength) == pytest.approx(whole(nu), abs=0.03)
    clear = np.full_like(SHARE, -50.0)
    assert loss(d, clear, (0.0, 0.0), wavelength) == 0
    skew = loss(d, edge, (3.0, 20.0), wavelength)
    assert skew == pytest.approx(loss(d, edge, (20.0, 3.0), wavelength), abs=1e-9)
    low = np.where(np.abs(SHARE - 0.5) < 1e-9, 0.0, -5.0)  # just below the line: a case of its own
    nu = d**2 / 8 / EARTH * np.sqrt(8 / (wavelength * d))
    assert loss(d, low, (0.0, 0.0), wavelength) == pytest.approx(whole(nu), abs=0.1)


def test_a_knife_edge_loses_what_fresnels_integrals_say() -> None:
    """P.526-15 (30), the exact loss, beside (31), its approximation: J(0) is half the field."""
    assert knife_edge_loss(np.array(0.0)) == pytest.approx(6.02, abs=0.02)
    nu = np.linspace(-0.7, 8.0, 200)
    S, C = fresnel(nu)
    exact = -20 * np.log10(np.hypot(1 - C - S, C - S) / 2)
    assert np.abs(knife_edge_loss(nu) - exact).max() < 0.2
    assert knife_edge_loss(np.array(-5.0)) == 0


def test_the_smooth_earth_hides_what_is_beyond_the_horizon() -> None:
    """Both see the earth at sqrt(2 R h): the slope there is d / 2R - sqrt(2 h / R)."""
    d, wavelength, h = 60e3, 0.3, 20.0
    slope = d / (2 * EARTH) - np.sqrt(2 * h / EARTH)
    nu = slope * d / 2 * np.sqrt(8 / (wavelength * d))
    j = float(knife_edge_loss(np.array(nu)))
    expected = j + (1 - np.exp(-j / 6)) * (10 + 0.02 * 60)
    assert loss(d, 0 * SHARE, (h, h), wavelength) == pytest.approx(expected, abs=0.02)


def tile(folder: Path, heights: Any, side: int = 1201, name: str = "N47E008.hgt") -> Path:
    """Write a tile of the function `heights` of metres east and north of the station."""
    degrees = np.arange(side) / (side - 1)
    east = (WEST + degrees - STATION[1]) * 75_300.0  # of a degree of longitude at 47.5 north
    north = (SOUTH + 1 - degrees - STATION[0]) * 111_180.0
    values = np.broadcast_to(heights(*np.meshgrid(east, north)), (side, side))
    np.round(values).astype(">i2").tofile(path := folder / name)
    return path


def ridge(x: Real, _: Real) -> Real:
    return np.asarray(500 + 100 * np.exp(-(((x - 400) / 150) ** 2)))


def test_a_ridge_hides_what_is_behind_it(tmp_path: Path) -> None:
    raster, unknown = read_terrain(tile(tmp_path, ridge))
    assert unknown == 0
    assert raster.step == pytest.approx(62.7, abs=0.1)
    heard: list[tuple[str, int, int]] = []
    found = terrain_map([raster], STATION, 2.4e9, (60.0, 80.0, 150.0), 0.0, 800.0, 50.0,
                        lambda *now: heard.append(now))  # fmt: skip
    assert heard[-1] == ("terrain", 33, 33)
    assert found.origin == pytest.approx((47.5, 8.5, 500), abs=1)
    at = {int(x): k for k, x in enumerate(found.east)}
    west, behind, above = (found.db[:, 16, at[x]] for x in (-500, 750, 400))
    assert (west == 0).all()
    assert np.isnan(above[:2]).all()
    assert found.barred(60.0)[16, at[400]]
    assert above[2] == 0
    assert (np.diff(behind) > 1).all()
    assert -50 < behind[0] < -25
    assert found.above_law
    assert found.ground is not None
    assert found.ground[16, at[400]] == pytest.approx(100, abs=6)


def test_a_path_loses_as_much_from_either_end(tmp_path: Path) -> None:
    """Over a ridge in the middle: with the mast as high as the aircraft was, and the other way."""
    raster, _ = read_terrain(tile(tmp_path, ridge))
    there, back = (
        terrain_map([raster], (*STATION[:2], mast), 2.4e9, (up,), 0.0, 800.0, 50.0).db[0, 16, -1]
        for mast, up in ((10.0, 60.0), (60.0, 10.0))
    )
    assert there < -20
    assert back == pytest.approx(there, abs=0.2)


def test_clutter_stands_on_the_ground_but_at_the_station(tmp_path: Path) -> None:
    """Its tops are the horizon of whoever stands below them."""
    raster, _ = read_terrain(tile(tmp_path, lambda *_: 500.0))
    bare, wood = (
        terrain_map([raster], STATION, 2.4e9, (30.0,), up, 500.0, 100.0) for up in (0.0, 20.0)
    )
    assert (bare.db == 0).all()
    assert wood.ground is not None
    assert wood.ground == pytest.approx(20)
    assert wood.db[0, 5, 5] == 0  # over the station
    assert wood.db[0, 5, -1] < -6
    low = terrain_map([raster], STATION, 2.4e9, (15.0,), 20.0, 500.0, 100.0)
    assert low.barred(15.0).all()


def test_heights_that_are_not_known_are_the_nearest_and_others_refused(tmp_path: Path) -> None:
    path = tile(tmp_path, lambda x, _: np.where(x < -400, -32768, 300 + 0 * x))
    raster, unknown = read_terrain(path)
    assert unknown > 1000
    assert (raster.values == 300).all()
    near = (47.001, 8.5, 10.0)
    with pytest.raises(InputError, match=r"no height at 46\.9\d+, 8\.4\d+; expected all of 800 m"):
        terrain_map([raster], near, 2.4e9, (60.0,), 0.0, 800.0, 50.0)
    south, _ = read_terrain(tile(tmp_path, lambda *_: 310.0, name="n46e008.hgt"))
    found = terrain_map([raster, south], near, 2.4e9, (60.0,), 0.0, 800.0, 50.0)
    assert found.ground is not None
    assert found.ground[[0, -1], 0] == pytest.approx([10, 0])
    with pytest.raises(InputError, match="expected at most 1,000,000: give --spacing"):
        terrain_map([raster], STATION, 2.4e9, (60.0,), 0.0, 1000.0, 1.0)
    for name, content, told in (
        ("N47E008.hgt", b"\0" * 99, "cannot be read as heights"),
        ("northwest.hgt", bytes(2 * 1201**2), "named as N47E008"),
        ("ridge.asc", b"ncols 9", "cannot be read as heights"),
        ("S01W001.hgt", b"\x80\0" * 1201**2, "no heights of -500 to 9000 m"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=f"{name}: .*{told}"):
            read_terrain(tmp_path / name)


def test_tiles_south_and_west_have_their_corner_there(tmp_path: Path) -> None:
    side = np.arange(1201)
    np.add.outer(-side, side).astype(">i2").tofile(path := tmp_path / "S36W071.hgt")
    raster = read_raster(path, "heights", 10**7)
    north, east = np.array([[-35.0, -71], [-36.0, -70], [-35.5, -70.25], [-36.1, -70.5]]).T
    heights = raster.at(north, east)
    np.testing.assert_allclose(heights, [0, 0, 300, np.nan], atol=1e-6)
