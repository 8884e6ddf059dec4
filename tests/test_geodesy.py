"""Local metres and WGS84 degrees."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod

from faao_mav.errors import InputError
from faao_mav.geodesy import LocalFrame

GEOD = Geod(ellps="WGS84")

latitudes = st.floats(-90, 90)
longitudes = st.floats(-180, 180)
metres = st.floats(-100_000, 100_000)


@given(latitudes, longitudes, metres, metres)
def test_there_and_back_is_the_same_place(
    latitude: float, longitude: float, east: float, north: float
) -> None:
    frame = LocalFrame(latitude, longitude)
    there = frame.to_geodetic([east, north])
    back = frame.to_local(*there)
    near = np.hypot(east, north) < 1.1e-3  # PROJ takes what is within 1 mm for the origin
    assert back == pytest.approx([east, north], abs=1.1e-3 if near else 1e-5)
    assert -180 <= there[1] < 180
    assert -90 <= there[0] <= 90


@given(st.floats(-89, 89), longitudes, st.floats(0.1, 100_000), st.floats(0, 2 * np.pi))
def test_distance_and_azimuth_from_the_origin_are_geodesic(
    latitude: float, longitude: float, distance: float, azimuth: float
) -> None:
    east, north = distance * np.sin(azimuth), distance * np.cos(azimuth)
    lat, lon = LocalFrame(latitude, longitude).to_geodetic([east, north])
    forward, _, length = GEOD.inv(longitude, latitude, lon, lat)
    # PROJ takes an origin within 1e-10 rad of the equator for one on it
    moved = 0 < abs(latitude) < np.degrees(1e-10)
    assert length == pytest.approx(distance, abs=1e-3 if moved else 1e-5)
    turn = (np.radians(forward) - azimuth + np.pi) % (2 * np.pi) - np.pi
    assert abs(turn) * distance < 1e-4


def test_the_antimeridian_and_the_poles_are_no_edges_whatever_the_shape() -> None:
    sides = np.array([[[-500.0, 0.0], [500.0, 0.0]]])
    for longitude in (180.0, -180.0, 179.9999):
        frame = LocalFrame(-17.0, longitude)
        lat, lon = frame.to_geodetic(sides)
        assert lon[0, 0] > 179
        assert lon[0, 1] < -179
        assert frame.to_local(-17.0, lon) == pytest.approx(sides, abs=0.01)
        assert lat.shape == lon.shape == (1, 2)
    for pole in (90.0, -90.0):
        lat, lon = LocalFrame(pole, 0.0).to_geodetic([[0.0, 0.0], [300.0, 400.0]])
        assert lat[0] == pole
        assert GEOD.inv(0.0, pole, lon[1], lat[1])[2] == pytest.approx(500.0, abs=1e-6)
        assert LocalFrame(pole, 0.0).to_geodetic([0.0, 0.0])[0].shape == ()


@pytest.mark.parametrize("origin", [(90.1, 0.0), (np.nan, 0.0), (0.0, np.inf)])
def test_an_origin_off_the_earth_is_refused(origin: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="expected a latitude from -90 to 90"):
        LocalFrame(*origin)
