"""Files of gain maps: what is read back, and what is refused."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame
from faao_mav.radio.gain_map import GainMap
from faao_mav.radio.map_file import WORD, map_archive, map_of_word, map_word, read_map, read_raster

EAST, NORTH = np.arange(0.0, 50.0, 10.0), np.arange(-20.0, 60.0, 20.0)
SOUND: dict[str, Any] = {"east": EAST, "north": NORTH, "gain_db": np.full((4, 5), -90.0)}


@st.composite
def maps(draw: st.DrawFn) -> GainMap:
    """Any map that a file may hold."""
    shape = draw(st.tuples(st.integers(1, 3), st.integers(2, 5), st.integers(2, 5)))
    place, step = st.floats(-5e4, 5e4), st.floats(0.01, 1e3)
    north, east = (np.arange(float(n)) * draw(step) + draw(place) for n in shape[1:])
    heights = np.cumsum(draw(arrays.arrays(float, shape[0], elements=st.floats(1, 500))))
    db = draw(arrays.arrays(float, shape, elements=st.floats(-300, 100) | st.just(np.nan)))
    up = arrays.arrays(float, shape[1:], elements=st.floats(-400, 9000))
    ground = draw(st.none() | up)
    degrees = st.tuples(st.floats(-89, 89), st.floats(-180, 180))
    origin = draw(st.just(()) | degrees | st.tuples(*[st.floats(-80, 80)] * 2, st.floats(0, 9000)))
    return GainMap(east, north, heights, db, draw(st.booleans()), ground, origin)


def same(a: GainMap, b: GainMap, off: float) -> None:
    """Assert that both maps are one, dB and ground within `off`."""
    for name in ("east", "north", "heights"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=1e-12, atol=2e-6)
    np.testing.assert_allclose(a.db, b.db, rtol=0, atol=off)
    assert (a.above_law, a.origin) == (b.above_law, b.origin)
    assert (a.ground is None) == (b.ground is None)
    if a.ground is not None and b.ground is not None:
        np.testing.assert_allclose(a.ground, b.ground, rtol=0, atol=off)


def table(found: GainMap) -> str:
    """The rows of a map, the last first."""
    kind = "above_law_db" if found.above_law else "gain_db"
    rows = []
    points = itertools.product(*map(enumerate, (found.heights, found.north, found.east)))
    for (j, up), (m, y), (k, x) in points:
        ground = f",{found.ground[m, k]}" if found.ground is not None else ""
        rows.append(f"{found.db[j, m, k]},{x:.9f},{up},{y:.9f}{ground}")
    header = f"{kind},East_m,height_m,north_m" + (",ground_m" if found.ground is not None else "")
    return "\n".join(["# by hand", header, *rows[::-1], ""])


@given(maps())
def test_maps_are_read_back(tmp_path_factory: pytest.TempPathFactory, found: GainMap) -> None:
    folder = tmp_path_factory.mktemp("maps")
    (folder / "a.npz").write_bytes(map_archive(found))
    same(read_map(folder / "a.npz"), found, 0.0)
    same(map_of_word(map_word(found)), found, 1e-3)
    word = map_word(map_of_word(map_word(found)))
    assert map_word(map_of_word(word)) == word
    if not found.origin:
        (folder / "a.csv").write_text(table(found))
        same(read_map(folder / "a.csv"), found, 1e-9)


def test_a_map_with_an_origin_of_its_own_is_moved_as_a_whole() -> None:
    """Places on it stay where they are on the globe, within the turn of the meridians."""
    own, plan = (47.03, 8.01, 500.0), (47.0, 8.0, 450.0)
    ground = np.full((4, 5), 3.0)
    found = GainMap(EAST, NORTH, np.array([60.0]), np.zeros((1, 4, 5)), False, ground, own)
    moved = found.about(*plan)
    assert (moved.heights.tolist(), moved.origin) == ([110.0], ())
    assert moved.ground is not None
    assert float(moved.ground[0, 0]) == 53.0
    for i, j in ((0, 0), (-1, -1), (0, -1)):
        before = LocalFrame(*own[:2]).to_geodetic(np.array([EAST[i], NORTH[j]]))
        after = LocalFrame(*plan[:2]).to_geodetic(np.array([moved.east[i], moved.north[j]]))
        np.testing.assert_allclose(after, before, rtol=0, atol=1e-7)
    assert found.about(47.0, 8.0, 500.0).heights[0] == 60.0
    with pytest.raises(InputError, match=r"origin: 47\.03, 8\.01, 500 lies 11\.\d km"):
        found.about(47.13, 8.0, 450.0)


def test_arrays_that_are_no_map_are_refused(tmp_path: Path) -> None:
    arrays_told: tuple[tuple[dict[str, Any], str], ...] = (
        ({"east": None}, "gain_db, north in it; expected a map with east, north and gain_db or"),
        ({"above_law_db": np.zeros((4, 5))}, "above_law_db, east, gain_db, north in it; expected"),
        ({"gain_db": np.zeros((2, 4, 5))}, r"gain_db: 2 x 4 x 5 .* \(height, north, east\)"),
        ({"gain_db": np.full((4, 5), np.inf)}, "gain_db: inf; expected -300 to 100 dB, NaN where"),
        ({"gain_db": np.full((4, 5), "-90")}, "gain_db: 1 x 4 x 5 of <U3; expected .* numbers"),
        ({"gain_db": np.float64(3)}, "gain_db: one of float64; expected 1 x 4 x 5 numbers"),
        ({"gain_db": np.zeros((1001, 1000)), "east": np.arange(1e3), "north": np.arange(1001.0)},
         "gain_db: 1 x 1001 x 1000 of float64; .*at most 1,000,000"),
        ({"east": np.array([0, 10, 20, 31, 40.0])}, "east: .* 0 to 40, among them 31; expected"),
        ({"east": EAST[::-1]}, "east: 5 numbers from 40 to 0.*; expected .* rise by even steps"),
        ({"east": EAST[:0], "gain_db": np.zeros((4, 0))}, "east: 0 numbers; expected at least two"),
        ({"east": np.where(EAST == 20, np.nan, EAST)}, "east: nan; expected -100000 to 100000 m"),
        ({"height": np.array([60.0, 60.0]), "gain_db": np.zeros((2, 4, 5))},
         "height: 2 numbers from 60 to 60; expected numbers that rise, m"),
        ({"ground": np.zeros((2, 2))}, "ground: 2 x 2 of float64; expected 4 x 5 numbers"),
        ({"origin": np.array([91.0, 0.0])}, "origin: .*expected latitude and longitude, degrees"),
        ({"origin": np.zeros(4)}, "origin: 4 of float64; expected 2 numbers"),
        ({"gain_db": np.array([{}], dtype=object)}, "not a map with east, north"),
    )  # fmt: skip
    for changes, told in arrays_told:
        kept = {k: v for k, v in (SOUND | changes).items() if v is not None}
        np.savez(tmp_path / "a.npz", **kept)
        with pytest.raises(InputError, match=f"a.npz: {told}"):
            read_map(tmp_path / "a.npz")


def test_tables_that_are_no_map_are_refused(tmp_path: Path) -> None:
    for text, told in (
        ("", "line 1: columns ''; give a header with east_m, north_m and gain_db, or"),
        ("east_m,north_m\n0,0\n", "line 1: columns 'east_m, north_m'"),
        ("east_m,north_m,gain_db\n0,0,x\n", "line 2: gain_db: 'x' is no number"),
        ("east_m,north_m,gain_db\n0,,-9\n", "line 2: north_m: '' is no number"),
        ("east_m,north_m,gain_db\n0,0,-9\n0,9,-9\n9,9,-9\n", "0 rows at north_m 0, east_m 9; "),
        ("east_m,north_m,gain_db\n0,0,-9\n#\n9,9,-9\n0,0,-8\n", "2 rows at north_m 0, east_m 0; "),
        ("east_m,north_m,height_m,gain_db,ground_m\n"
         + "".join(f"{x},{y},{z},-9,{z}\n" for x in (0, 9) for y in (0, 9) for z in (50, 60)),
         "ground_m: differs between heights; expected one at a place"),
    ):  # fmt: skip
        (tmp_path / "a.csv").write_text(text)
        with pytest.raises(InputError, match=f"a.csv: {told}"):
            read_map(tmp_path / "a.csv")


def test_files_that_are_no_archive_are_refused(tmp_path: Path) -> None:
    for name, told in (("a.npz", "not a map"), ("a.tif", "cannot be read"), ("a.json", "ends in")):
        if name.endswith("tif"):
            pytest.importorskip("rasterio")
        (tmp_path / name).write_bytes(b"PK\3\4 nothing")
        with pytest.raises(InputError, match=f"{name}: .*{told}"):
            read_map(tmp_path / name)
    with pytest.raises(InputError, match=r"none\.npz: cannot be read"):
        read_map(tmp_path / "none.npz")


def test_words_that_are_no_map_are_refused() -> None:
    sound = map_word(GainMap(EAST, NORTH, np.array([60.0]), np.zeros((1, 4, 5))))
    for word in (WORD, WORD + "AAAA", WORD + "ä", sound[:-40]):
        with pytest.raises(InputError, match=r"not the numbers of a map|missing"):
            map_of_word(word)


def test_a_geotiff_of_any_projection_becomes_a_local_grid(tmp_path: Path) -> None:
    """Of a plane over the globe, in degrees and in metres of UTM, every point is where it was."""
    rasterio: Any = pytest.importorskip("rasterio")
    from pyproj import Transformer

    for crs, corner, step, west in (
        ("EPSG:4326", (8.0, 47.01), 1e-4, 8.0),
        ("EPSG:4326", (179.996, 47.01), 1e-4, 179.996),
        ("EPSG:32632", (424e3, 5207e3), 9, 8.0),
    ):
        to_degrees = Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
        x, y = np.meshgrid(
            corner[0] + step * (np.arange(90) + 0.5), corner[1] - step * (np.arange(80) + 0.5)
        )
        longitude, latitude = to_degrees.transform(x, y)
        counts = 4e3 * (latitude - 47.0) - 2e3 * (longitude - west)  # a quarter of a dB each
        counts[3, 4] = -9999
        path = tmp_path / "a.tif"
        told = {"count": 1, "dtype": "float64", "crs": crs, "nodata": -9999}
        told["transform"] = rasterio.Affine(step, 0, corner[0], 0, -step, corner[1])
        with rasterio.open(path, "w", driver="GTiff", width=90, height=80, **told) as file:
            file.write(counts, 1)
            file.scales, file.offsets = (0.25,), (-90.0,)
        found = read_map(path)
        grid = np.stack(np.meshgrid(found.east, found.north), axis=-1)
        latitude, longitude = LocalFrame(*found.origin[:2]).to_geodetic(grid)
        east = (longitude - west) % 360
        off = found.db[0] + 90.0 - 1e3 * (latitude - 47.0) + 500 * east
        assert np.isnan(off).any()
        assert np.nanmax(np.abs(off[3:-3, 3:-3])) < 1e-3  # at the edge it is the nearest cell's
        assert read_raster(path, "a map", 7_200).values.shape == (80, 90)
        with pytest.raises(InputError, match=r"90 x 80 cells, .* at most 7,199 cells"):
            read_raster(path, "a map", 7_199)
        told |= {"count": 2, "crs": None}
    with rasterio.open(path, "w", driver="GTiff", width=9, height=8, **told) as file:
        file.write(np.zeros((2, 8, 9)))
    with pytest.raises(InputError, match=r"a\.tif: 2 bands, 9 x 8 cells, no coordinates; expected"):
        read_map(path)
    told |= {"count": 1, "crs": crs, "transform": rasterio.Affine(9, 0, 424e3, 0, 0, 5207e3)}
    with rasterio.open(path, "w", driver="GTiff", width=9, height=8, **told):
        pass  # its rows are all in one place
    with pytest.raises(InputError, match=r"a\.tif: cannot be read as a map"):
        read_map(path)
