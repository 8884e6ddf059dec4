"""Levels measured in flight: tables of them, the law that is fitted, the map of what it leaves."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.radio.fit import LinkFit, Samples, fit_link
from faao_mav.radio.kriging import kriged
from faao_mav.radio.measured import read_measured
from faao_mav.radio.rate_steps import RateSteps
from faao_mav.radio.spline import Spline


def flight(height: float, seed: int = 0, rows: int = 6) -> Samples:
    """A flight of `rows` legs of 400 m, 60 m apart, 8 m/s, read twice a second, of no level."""
    ends = [(x, y) for k in range(rows) for x, y in [(-200, 60 * k), (200, 60 * k)][:: (-1) ** k]]
    corners = np.array(ends, dtype=float) + np.array([17.0, -113.0 + seed])
    away = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    t = np.arange(0.0, away[-1] / 8.0, 0.5)
    east, north = (np.interp(8.0 * t, away, c) for c in corners.T)
    return Samples(t, np.stack([east, north, np.full_like(t, height)], axis=1), np.zeros_like(t))


def law(gain: tuple[float, ...], place: Real) -> Real:
    """The law `gain` (level, exponent, c_1, ...), dB, at `place` (k, 3)."""
    d = np.linalg.norm(place, axis=1)
    terms = [c * (place[:, 2] / d) ** k for k, c in enumerate(gain[2:], 1)]
    return np.asarray(gain[0] - 10 * gain[1] * np.log10(d) + sum(terms))


def levels(
    flights: list[Samples], gain: tuple[float, ...], spread: float, length: float, seed: int
) -> list[Samples]:
    """Levels of the law `gain` (level, exponent, c_1, ...) with shadowing and fast fading, dB."""
    rng = np.random.default_rng(seed)
    place = np.concatenate([each.place for each in flights])
    apart = np.linalg.norm(place[:, None] - place[None], axis=2)
    root = np.linalg.cholesky(np.exp(-apart / length) + 1e-9 * np.eye(len(place)))
    fast = 10 * np.log10(np.mean(rng.exponential(size=(10, len(place))), axis=0))
    level = law(gain, place) + spread * root @ rng.standard_normal(len(place)) + fast
    cuts = np.cumsum([len(each.t) for each in flights])[:-1]
    return [replace(f, level=x) for f, x in zip(flights, np.split(level, cuts), strict=True)]


def off(fit: LinkFit, gain: tuple[float, ...]) -> float:
    """The rms error of the fitted gain where it was flown, dB."""
    place = fit.flown.place
    return float(np.sqrt(np.mean((fit.gain_db(place) - law(gain, place)) ** 2)))


LAWS = [(-40.0, 2.0), (-45.0, 2.7), (-50.0, 2.0, 30.0, -25.0), (-48.0, 2.0, 20.0)]


def test_laws_are_found_within_their_stated_errors() -> None:
    flights = [flight(height, seed, 5) for seed, height in enumerate((40.0, 80.0, 120.0))]
    for seed, gain in enumerate(LAWS):
        fit = fit_link(levels(flights, gain, 4.0, 30.0, seed))
        assert fit.heights == 3
        assert fit.legs >= 15
        assert off(fit, gain) <= 3.0 * fit.gain_error_db
        assert fit.spread_db == pytest.approx(4.2, rel=0.25)
        assert 10.0 < fit.correlation_m < 90.0
        assert fit.holds


def test_errors_are_those_of_shadowing_correlated_beyond_a_leg() -> None:
    gain, flown = (-45.0, 2.0), [flight(60.0)]
    fits = [fit_link(levels(flown, gain, 6.0, 60.0, seed)) for seed in range(8)]
    missed, told = np.mean([[off(fit, gain) ** 2, fit.gain_error_db**2] for fit in fits], axis=0)
    assert 0.4 * told < missed < 2.0 * told


@settings(max_examples=10)
@given(st.floats(-70, -20), st.floats(1.6, 4.0), st.lists(st.floats(-15, 15), max_size=2))
def test_without_noise_the_law_itself_is_found(
    level: float, exponent: float, terms: list[float]
) -> None:
    gain = (level, exponent, *terms)
    flights = [flight(height, rows=3) for height in (40.0, 90.0)]
    exact = [replace(f, level=law(gain, f.place)) for f in flights]
    fit = fit_link(exact, seconds=0.5)
    assert off(fit, gain) < 0.05


def test_outliers_move_nothing() -> None:
    gain = (-45.0, 2.0, 20.0)
    clean = levels([flight(50.0), flight(100.0, 1)], gain, 3.0, 30.0, 1)
    rare = [60.0 * (np.arange(len(each.t)) % 40 == 0) for each in clean]
    struck = [replace(each, level=each.level + x) for each, x in zip(clean, rare, strict=True)]
    assert off(fit_link(struck), gain) < off(fit_link(clean), gain) + 1.0


def test_what_is_not_finite_or_not_flown_is_left_out() -> None:
    (sound,) = levels([flight(50.0)], (-45.0, 2.0), 3.0, 30.0, 2)
    gaps = sound.level.copy()
    gaps[5:20], gaps[40] = np.nan, np.inf
    ground = np.vstack([sound.place, np.tile([5.0, 5.0, 0.5], (60, 1))])
    t = np.concatenate([sound.t, sound.t[-1] + 1 + np.arange(60.0)])
    fit = fit_link([Samples(t, ground, np.concatenate([gaps, np.full(60, -20.0)]))])
    assert fit.means == pytest.approx(len(sound.t) / 4, abs=6)
    assert off(fit, (-45.0, 2.0)) < 3.0


def test_a_low_leg_is_flown_too_and_a_clock_may_begin_anew() -> None:
    parts = [flight(30.0, rows=2), flight(110.0)]
    rows = [np.column_stack([each.t, each.place, each.level]) for each in parts]
    t, *place, level = np.concatenate(rows).T
    found = Samples(t, np.stack(place, axis=1), level).means(2.0)
    apart = np.concatenate([each.means(2.0).place for each in parts])
    np.testing.assert_allclose(found.place, apart[1:])  # the first is not known to be underway
    order = np.argsort(parts[1].level)
    mixed = Samples(parts[1].t[order], parts[1].place[order], parts[1].level[order])
    np.testing.assert_allclose(mixed.means(2.0).place, parts[1].means(2.0).place)


def test_one_leg_gives_the_level_alone() -> None:
    one = flight(50.0, rows=1)
    fit = fit_link(levels([one], (-45.0, 2.0, 30.0, -20.0), 3.0, 30.0, 0))
    assert fit.legs == 1
    assert (fit.exponent, fit.elevation_db) == (2.0, ())
    assert fit.gain_error_db == np.inf
    assert kriged(fit, STATION)[0] is None


def test_no_flight_is_refused() -> None:
    (some,) = levels([flight(50.0)], (-45.0, 2.0), 3.0, 30.0, 2)
    with pytest.raises(InputError, match="one place alone"):
        fit_link([replace(some, place=0 * some.place + 40.0)])
    with pytest.raises(InputError, match="one level alone, 5 dB"):
        fit_link([replace(some, level=0 * some.level + 5.0)])
    some = Samples(some.t[:20], some.place[:20], some.level[:20], "f.csv")
    with pytest.raises(InputError, match=r"f\.csv: 5 means over 2 s in flight"):
        fit_link([some])


def test_no_spread_of_elevations_gives_no_terms_that_run_wild() -> None:
    """High above and far away the sine hardly changes: its terms would be anything elsewhere."""
    far = flight(30.0)
    far = replace(far, place=far.place + np.array([3000.0, 0.0, 0.0]))
    for seed in range(2):
        fit = fit_link(levels([far], (-45.0, 2.0), 3.0, 30.0, seed))
        s = np.linspace(0.0, 1.0, 50)
        swing = np.ptp(sum((c * s**k for k, c in enumerate(fit.elevation_db, 1)), 0.0 * s))
        assert swing <= 40.0
        assert off(fit, (-45.0, 2.0)) < 3.0
    steep = replace(far, level=-0.1 * far.place[:, 0])  # as if another station had been heard
    assert 0.0 <= fit_link([steep]).exponent <= 10.0


SIDE = np.arange(-400.0, 401.0, 10.0)
STATION = (47.0, 8.0, 5.0)


def field(seed: int, spread: float) -> Spline:
    """A smooth field of shadowing over the map, correlated over some 80 m."""
    noise = np.random.default_rng(seed).standard_normal((len(SIDE), len(SIDE)))
    smooth = gaussian_filter(noise, 5.0)
    return Spline.through(SIDE, SIDE, spread * smooth / smooth.std())


def legs(shadow: Spline, noise: float) -> Samples:
    """Legs east and west, 40 m apart, 60 m above the antenna, past it and about it."""
    t = np.arange(0.0, 600.0)
    leg, along = np.divmod(10.0 * t, 600.0)
    x = np.where(leg % 2 == 0, along - 300.0, 300.0 - along)
    place = np.stack([x, 40.0 * leg - 200.0, np.full_like(t, 60.0)], axis=1)
    level = -45.0 - 20 * np.log10(np.linalg.norm(place, axis=1)) + shadow.value(x, place[:, 1])
    return Samples(t, place, level + noise * np.random.default_rng(9).standard_normal(len(t)))


def apart(shadow: Spline, value: Real, x: Real, y: Real) -> float:
    return float(np.sqrt(np.mean((shadow.value(x, y) - value) ** 2)))


def test_the_map_tells_a_field_between_the_legs() -> None:
    shadow = field(1, 4.0)
    fit = fit_link([legs(shadow, 1.0)], 1.0)
    found, alone, error = kriged(fit, STATION)
    assert found is not None
    assert error < 0.8 * alone
    x, y = np.meshgrid(np.linspace(-280, 280, 30), np.arange(-180.0, 180.0, 40.0))
    law = fit.gain_db(np.stack([x, y, np.full_like(x, 60.0)], axis=-1))
    true = -45.0 - 10 * np.log10(x**2 + y**2 + 60.0**2)
    told = found.at(60.0).value(x, y)
    assert apart(shadow, told + law - true, x, y) < 0.5 * 4.0
    share = np.mean(told * (shadow.value(x, y) + true - law)) / np.mean(told**2)
    assert share == pytest.approx(1, abs=0.1)
    assert abs(found.at(60.0).value(np.array(2000.0), np.array(0.0))) < 1e-9
    assert (found.origin, found.above_law) == ((47.0, 8.0), True)
    assert found.heights[0] <= 60 <= found.heights[-1]


def test_of_noise_there_is_no_map() -> None:
    found, alone, error = kriged(fit_link([legs(field(4, 1e-9), 3.0)], 1.0), STATION)
    assert error > 0.97 * alone
    assert found is None or np.abs(found.db).max() < 3.0


ANTENNA = (-35.0, 149.0, 10.0)
RATES = RateSteps((0.0, 5.0, 10.0, 15.0), (1.0, 6.0, 20.0, 30.0))


def table(folder: Path, header: str, level: object, separator: str = ",") -> Path:
    """A table of 20 rows that fly north from 111 m north of the station, at 60 m."""
    cells = [(k, round(-34.999 + 1e-5 * k, 6), 149.0, 60.0, level) for k in range(20)]
    rows = [separator.join(map(str, row)) for row in cells]
    path = folder / "levels.csv"
    path.write_text("\n".join([header.replace(",", separator), *rows, ""]))
    return path


def test_headers_tell_what_is_measured(tmp_path: Path) -> None:
    for header, level, unit, value in (
        ("time_s,latitude,longitude,altitude_m,rsrp_dbm", -80.5, "dbm", -80.5),
        ("Time [s],Lat (deg),Lon (deg),Alt (m),RSRP [dBm]", -80.5, "dbm", -80.5),
        ("t,lat,lng,height_m,SINR (dB)", 12.0, "db", 12.0),
        ("timestamp_s,latitude,longitude,altitude_m,throughput_mbit_per_s", 20.0, "db", 12.5),
        ("time_s,lat,lon,altitude_m,throughput kbit/s", 13000.0, "db", 10.0),
        ("time_s,lat,lon,alt_m,rssi_sik", 133, "dbm", -57.0),
    ):
        found = read_measured(table(tmp_path, header, level), ANTENNA, rates=RATES)
        assert (found.unit, found.left_out) == (unit, 0)
        np.testing.assert_allclose(found.level, value)
        np.testing.assert_allclose(found.place[0], [0.0, 110.94, 50.0], atol=0.1)


def test_units_that_a_header_does_not_tell_are_asked_for(tmp_path: Path) -> None:
    path = table(tmp_path, "time,lat,lon,alt,rssi", -70)
    with pytest.raises(InputError, match=r"'alt' has no unit.*--unit altitude=UNIT, one of m"):
        read_measured(path, ANTENNA)
    units = {"altitude": "ft", "rssi": "dBm"}
    found = read_measured(path, ANTENNA, units)
    np.testing.assert_allclose(found.place[:, 2], 60 * 0.3048 - 10)
    path.write_text(path.read_text().replace(",-34", "000,-34"))
    with pytest.raises(InputError, match="1000 s from row to row; give the unit, as --un"):
        read_measured(path, ANTENNA, units)
    assert read_measured(path, ANTENNA, units | {"time": "ms"}).t[-1] == 19.0


def test_counts_of_a_device_are_calibrated(tmp_path: Path) -> None:
    path = table(tmp_path, "time_s,lat,lon,alt_m,rssi", 100)
    raw, sik = {"rssi": "raw"}, {"rssi": "sik"}
    for units, calibration, level in (
        (sik, (), 100 / 1.9 - 127),
        (sik, [(119, -50)], -60.0),
        (raw, [(20, -110), (200, -20)], -70.0),
    ):
        found = read_measured(path, ANTENNA, units, calibration)
        np.testing.assert_allclose(found.level, level)
    with pytest.raises(InputError, match=r"expected two of them in dBm by --calibrate"):
        read_measured(path, ANTENNA, raw, [(0, -120)])


def test_decimal_commas_times_of_day_and_rows_without_a_number(tmp_path: Path) -> None:
    header = "time;lat;lon;alt_m;snr_db"
    rows = [f"2024-05-01T10:00:{k:02d}Z;-34,999;149,0;60,0;1{k % 10},5" for k in range(20)]
    rows[3], rows[7], rows[9] = "not a row", "2024-05-01T10:00:07Z;-34,999;149,0;60,0;NaN", ""
    rows[5] = "2024-05-01T10:00:05Z;-34,999;149,0;60,0;2024-05-01"  # of times alone a number
    rows[11] = "2024-05-01T10:00:11Z;0;0;60,0;11,5"  # no fix
    rows[13] = "2024-05-01T10:00:13Z;214,7;0;60,0;11,5"
    rows[12] = "2024-05-01T10:00:12Z;-34,999;149,0;60,0;9999"  # no level
    path = tmp_path / "levels.csv"
    path.write_text("\n".join(["# a remark", header, *rows]))
    found = read_measured(path, ANTENNA)
    assert (len(found.t), found.left_out) == (13, 6)
    assert (np.ptp(found.t), found.level[0]) == (19.0, 10.5)


def test_other_tables_are_refused(tmp_path: Path) -> None:
    for header, level, message in (
        ("time_s,lat,lon,alt_m,loss_db", 3, "line 1: no column of one of rsrp, rssi, snr, throu"),
        ("time_s,lat,alt_m,x,rsrp_dbm", 3, "line 1: no column of longitude"),
        ("time_s,lat,lon,alt_m,rsrp_watt", 3, "'rsrp_watt' has unit 'watt'.*one of dbm"),
        ("time_s,lat,lon,alt_m,rsrp_dbm", 180, "levels about 180 dbm; expected -200 to 60"),
        ("time_s,lon,lat,alt_m,rsrp_dbm", -80, "inf km from --station -35,149.*exchanged"),
        ("time_s,lat,alt_m,lon,rsrp_dbm", -80, "km from --station -35,149.*exchanged"),
        ("time_s,lat,lon,alt_m,rsrp_dbm", "none", "no row with time, latitude"),
        ("time_s,lat,lon,alt_m,throughput_bps", 5e6, "a throughput; give --rates"),
    ):
        with pytest.raises(InputError, match=message):
            read_measured(table(tmp_path, header, level), ANTENNA)


@given(st.text(alphabet='time_s,latonrspdbm(;\t"0123456789.-eNinf \n', max_size=300))
def test_any_text_is_a_table_or_refused(
    tmp_path_factory: pytest.TempPathFactory, text: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.csv"
    for content in (b"", b"\n\n", b"\xff\xfe\x00", b"time_s,lat,lon,alt_m,snr_db"):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"any\.csv"):
            read_measured(path, ANTENNA)
    path.write_text(f"time_s,lat,lon,alt_m,rsrp_dbm\n{text}")
    try:
        found = read_measured(path, ANTENNA)
    except InputError as error:
        assert "any.csv" in str(error)
    else:
        assert np.isfinite(found.place).all()
