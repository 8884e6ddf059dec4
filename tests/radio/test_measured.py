"""Tables of measured levels: what headers are called, units, and what is no such table."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.errors import InputError
from faao_mav.radio.measured import read_measured

STATION = (-35.0, 149.0, 10.0)


def table(folder: Path, header: str, level: object, separator: str = ",") -> Path:
    """A table of 20 rows that fly north from 111 m north of the station, at 60 m."""
    rows = [
        separator.join(map(str, (k, round(-34.999 + 1e-5 * k, 6), 149.0, 60.0, level)))
        for k in range(20)
    ]
    path = folder / "levels.csv"
    path.write_text("\n".join([header.replace(",", separator), *rows, ""]))
    return path


@pytest.mark.parametrize(
    ("header", "level", "unit", "value"),
    [
        ("time_s,latitude,longitude,altitude_m,rsrp_dbm", -80.5, "dbm", -80.5),
        ("Time [s],Lat (deg),Lon (deg),Alt (m),RSRP [dBm]", -80.5, "dbm", -80.5),
        ("t,lat,lng,height_m,SINR (dB)", 12.0, "db", 12.0),
        ("timestamp_s,latitude,longitude,altitude_m,throughput_mbit_per_s", 20.0, "mbit/s", 20.0),
        ("time_s,lat,lon,altitude_m,throughput kbit/s", 500.0, "mbit/s", 0.5),
        ("time_s,lat,lon,alt_m,rssi_sik", 133, "dbm", -57.0),
    ],
)
def test_headers_tell_what_is_measured(
    tmp_path: Path, header: str, level: float, unit: str, value: float
) -> None:
    found = read_measured(table(tmp_path, header, level), STATION)
    assert found.unit == unit
    np.testing.assert_allclose(found.samples.level, value)
    np.testing.assert_allclose(found.samples.place[0], [0.0, 110.94, 50.0], atol=0.1)
    assert found.left_out == 0


def test_units_that_a_header_does_not_tell_are_asked_for(tmp_path: Path) -> None:
    path = table(tmp_path, "time,lat,lon,alt,rssi", -70)
    with pytest.raises(InputError, match=r"'alt' has no unit.*--unit altitude=UNIT, one of m"):
        read_measured(path, STATION)
    found = read_measured(path, STATION, {"altitude": "ft", "rssi": "dBm"})
    np.testing.assert_allclose(found.samples.place[:, 2], 60 * 0.3048 - 10)


def test_counts_of_a_device_are_calibrated(tmp_path: Path) -> None:
    path = table(tmp_path, "time_s,lat,lon,alt_m,rssi", 100)
    raw, sik = {"rssi": "raw"}, {"rssi": "sik"}
    for units, calibration, level in (
        (sik, (), 100 / 1.9 - 127),
        (sik, [(119, -50)], -60.0),
        (raw, [(20, -110), (200, -20)], -70.0),
    ):
        found = read_measured(path, STATION, units, calibration)
        np.testing.assert_allclose(found.samples.level, level)
        assert found.unit == "dbm"
    with pytest.raises(InputError, match=r"expected two of them in dBm by --calibrate"):
        read_measured(path, STATION, raw, [(0, -120)])


def test_decimal_commas_times_of_day_and_rows_without_a_number(tmp_path: Path) -> None:
    header = "time;lat;lon;alt_m;snr_db"
    rows = [f"2024-05-01T10:00:{k:02d}Z;-34,999;149,0;60,0;1{k % 10},5" for k in range(20)]
    rows[3], rows[7], rows[9] = "not a row", "2024-05-01T10:00:07Z;-34,999;149,0;60,0;NaN", ""
    path = tmp_path / "levels.csv"
    path.write_text("\n".join(["# a remark", header, *rows]))
    found = read_measured(path, STATION)
    assert (len(found.samples.t), found.left_out) == (17, 2)
    assert np.ptp(found.samples.t) == 19.0
    assert found.samples.level[0] == 10.5


@pytest.mark.parametrize(
    ("header", "level", "message"),
    [
        ("time_s,lat,lon,alt_m,loss_db", 3, "line 1: no column of one of rsrp, rssi, snr, throu"),
        ("time_s,lat,alt_m,x,rsrp_dbm", 3, "line 1: no column of longitude"),
        ("time_s,lat,lon,alt_m,rsrp_watt", 3, "'rsrp_watt' has unit 'watt'.*one of dbm"),
        ("time_s,lat,lon,alt_m,rsrp_dbm", 180, "levels about 180 dbm; expected -200 to 60"),
        ("time_s,lon,lat,alt_m,rsrp_dbm", -80, "a latitude beyond 90"),
        ("time_s,lat,alt_m,lon,rsrp_dbm", -80, "km from --station -35,149.*exchanged"),
        ("time_s,lat,lon,alt_m,rsrp_dbm", "none", "no row with time, latitude"),
    ],
)
def test_other_tables_are_refused(tmp_path: Path, header: str, level: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_measured(table(tmp_path, header, level), STATION)


@given(st.text(alphabet='time_s,latonrspdbm(;\t"0123456789.-eNinf \n', max_size=300))
def test_any_text_is_a_table_or_refused(
    tmp_path_factory: pytest.TempPathFactory, text: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.csv"
    for content in (b"", b"\n\n", b"\xff\xfe\x00", b"time_s,lat,lon,alt_m,snr_db"):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"any\.csv"):
            read_measured(path, STATION)
    path.write_text(f"time_s,lat,lon,alt_m,rsrp_dbm\n{text}")
    try:
        found = read_measured(path, STATION)
    except InputError as error:
        assert "any.csv" in str(error)
    else:
        assert np.isfinite(found.samples.place).all()
