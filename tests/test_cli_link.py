"""`faao-mission link`: from logs of a flight to the file that a plan's `gain` names."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import SMALL, edited
from flight_logs import dataflash, heard, tlog, ulog
from typer.testing import CliRunner

from faao_mav.arrays import Real
from faao_mav.cli.main import app
from faao_mav.geodesy import LocalFrame
from faao_mav.optimizer.problem import build_problem
from faao_mav.plan import read_plan
from faao_mav.plan.yaml_text import load_yaml
from faao_mav.validate.flown import FlightRecord

STATION = (-35.36, 149.16, 5.0)
PLACE = ",".join(map(str, STATION))
LAW = (-45.0, 2.0)


def record(height: float, spread: float = 2.0, seed: int = 0) -> FlightRecord:
    """A flight about the station at a height above home, with what a SiK radio counts there."""
    t = np.arange(0.0, 240.0, 0.5)
    leg, along = np.divmod(8.0 * t, 320.0)
    east = np.where(leg % 2 == 0, along - 150.0, 170.0 - along) + 7.0
    north = 40.0 * leg - 60.0
    latitude, longitude = LocalFrame(*STATION[:2]).to_geodetic(np.stack([east, north], axis=1))
    up = height - STATION[2]
    d = np.sqrt(east**2 + north**2 + up**2)
    shadow = spread * np.random.default_rng(seed).standard_normal(len(t) // 8)
    gain = LAW[0] - 10 * LAW[1] * np.log10(d) + np.repeat(shadow, 8)
    count = np.round((20.0 + gain + 127.0) * 1.9)
    home = np.full_like(t, 584.0)
    wind = np.full((len(t), 2), np.nan)
    return FlightRecord(t + 10.0, latitude, longitude, home + height, home, wind, count)


def table(
    folder: Path,
    flight: FlightRecord,
    column: str = "rssi_dbm",
    of: Callable[[Real], Real] = lambda dbm: dbm,
) -> Path:
    """Write the table of a flight, with what is measured in a `column`, `of` the power, dBm."""
    path, up = folder / "flight.csv", flight.altitude - flight.home
    columns = (flight.t, flight.latitude, flight.longitude, up, of(flight.rssi / 1.9 - 127))
    header = f"time_s,latitude,longitude,altitude_m,{column}"
    np.savetxt(path, np.stack(columns, axis=1), "%.8f", ",", header=header, comments="")
    return path


def link(*arguments: object, status: int = 0) -> str:
    result = CliRunner().invoke(app, ["link", *map(str, arguments)])
    assert result.exit_code == status, result.output + result.stderr
    return result.stdout if status < 2 else result.stderr


def test_logs_of_every_kind_give_the_law_that_was_flown(tmp_path: Path) -> None:
    flights = [record(height, seed=k) for k, height in enumerate((50.0, 80.0, 120.0))]
    first, second, third = flights
    written = {"a.bin": dataflash(first), "b.tlog": tlog(heard(second)), "c.ulg": ulog(third)}
    logs = [tmp_path / name for name in written]
    for path in logs:
        path.write_bytes(written[path.name])
    out, page = tmp_path / "link.yaml", tmp_path / "link.html"
    told = json.loads(
        link(*logs, "--station", PLACE, "--unit", "rssi=sik", "--unit", "altitude=ft",  # of tables
             "--power", 20, "--out", out, "--report", page, "--json")
    )  # fmt: skip
    assert told["heights"] == 3
    assert told["exponent"] == 2.0
    assert told["reference_gain_db"] == pytest.approx(LAW[0], abs=1.0)
    assert told["spread_db"] == pytest.approx(2.0, rel=0.3)
    law = out.read_text()
    assert f"reference_gain_db: {round(told['reference_gain_db'], 2)}\n" in law
    assert "a.bin, b.tlog, c.ulg" in law
    angle, d = (load_yaml(law, "link.yaml")[key] for key in ("elevation_deg", "distance_m"))
    assert angle == pytest.approx(told["elevation_deg"], abs=0.1)
    assert d == pytest.approx(told["distance_m"], rel=1e-3)
    assert 45 <= d[0] < 60  # the lowest flight passes the station 45 m above it
    assert 60 < angle[1] <= 90
    text = page.read_text()
    assert text.count("<svg") == 2
    assert "<image" not in text


def test_without_a_power_the_shape_is_told_where_no_law_holds_nothing_is_written(
    tmp_path: Path,
) -> None:
    path, out = table(tmp_path, record(60.0)), tmp_path / "link.yaml"
    text = link(path, "--station", PLACE, "--out", out)
    assert "shape only: the plan's radio.reference_gain_db stands" in text
    assert "reference_gain_db" not in out.read_text()
    out.unlink()
    table(tmp_path, record(60.0, spread=25.0))
    text = link(path, "--station", PLACE, "--out", out, status=1)
    assert "no law       of distance and elevation holds" in text
    told = json.loads(link(path, "--station", PLACE, "--out", out, "--json", status=1))
    assert (told["holds"], told["written"], out.exists()) == (False, [], False)


def test_what_the_law_leaves_is_a_map_above_it(tmp_path: Path) -> None:
    """Shadowing that depends on the place alone; the plan names the law, and that names the map."""
    flight = record(60.0, spread=0.0)
    x, y = LocalFrame(*STATION[:2]).to_local(flight.latitude, flight.longitude).T
    shadow = 6.0 * np.sin(x / 60) * np.cos(y / 70)
    path = table(tmp_path, replace(flight, rssi=flight.rssi + np.round(1.9 * shadow)))
    (tmp_path / "maps").mkdir()
    out, found = tmp_path / "link.yaml", tmp_path / "maps" / "m\U0001f4e1'\".npz"
    given = (path, "--station", PLACE, "--power", 20, "--out", out, "--map", found)
    text = " ".join(link(*given).split())
    assert "dB at legs left out one by one," in text
    assert f"files {out}, {found}" in text
    told = json.loads(link(*given, "--json"))
    assert told["left_out_map_db"] < 0.8 * told["left_out_db"]
    assert load_yaml(out.read_text(), "link.yaml")["map"] == f"maps/{found.name}"
    plan = small_plan(tmp_path, {"latitude": STATION[0], "longitude": STATION[1], "elevation": 99})
    above = build_problem(read_plan(plan)).bs_uav.gains.above
    assert above is not None
    seen = np.hypot(x, y) < 120
    off = above.value(x[seen], y[seen]) - (shadow[seen] - shadow[seen].mean())
    assert np.std(off) < 2.0


def small_plan(folder: Path, origin: dict[str, float]) -> Path:
    """Write a plan whose gain is link.yaml, about an origin."""
    changes = {"radio.gain": "link.yaml", "site.origin": origin, "flight.altitude": 60}
    path = folder / "plan.yaml"
    path.write_text(edited(SMALL, changes))
    return path


def test_terrain_tells_free_space_and_what_it_takes(tmp_path: Path) -> None:
    tile = tmp_path / "S36E149.hgt"
    east = np.arange(1201) / 1200 + 149 - STATION[1]
    row = 580 + 80 * np.exp(-(((east * 90_900 - 400) / 120) ** 2))
    tile.write_bytes(np.broadcast_to(np.round(row), (1201, 1201)).astype(">i2").tobytes())
    out = tmp_path / "link.yaml"
    given = ("--terrain", tile, "--station", PLACE, "--frequency", 2400, "--heights", "60,90",
             "--radius", 800, "--spacing", 40, "--out", out)  # fmt: skip
    text = " ".join(link(*given).split())
    assert "gain -40.1 - 20 log10 d dB, in free space" in text
    assert "41 x 41 points by 40 m, 60, 90 m above that ground" in text
    told = json.loads(link(*given, "--json"))
    assert told["origin"] == [*STATION[:2], pytest.approx(580, abs=1)]
    assert told["written"] == [str(out), str(tmp_path / "link.npz")]
    low, high = told["losses"]
    assert 30 < low["most_db"] < 60
    assert 0.02 < low["below_ground"] < 0.2
    assert low["most_db"] > high["most_db"] > 20
    assert 0.1 < high["over_6_db"] <= low["over_6_db"] < 0.4
    plan = read_plan(small_plan(tmp_path, dict(zip(ORIGIN, (*STATION[:2], 570), strict=True))))
    found = plan.radio.gain.map
    assert found is not None
    assert found.heights == pytest.approx([70, 100], abs=1)  # above the plan's origin
    gains = build_problem(plan).bs_uav.gains
    near, behind = 10 * np.log10(gains.gain(np.array([[-300.0, 700.0], [0.0, 0.0]])))
    assert near == pytest.approx(-40.05 - 20 * np.log10(np.hypot(300, 60)), abs=0.1)
    assert behind < -40.05 - 20 * np.log10(700) - 15


ORIGIN = ("latitude", "longitude", "elevation")


def test_logs_without_a_radio_or_its_unit_are_told(tmp_path: Path) -> None:
    flight, log = record(60.0), tmp_path / "flight.bin"
    log.write_bytes(dataflash(flight))
    assert "means of flight.bin" in link(log, "--station", PLACE, "--unit", "rssi=sik")
    assert "--unit rssi=sik" in link(log, "--station", PLACE, status=2)
    log.write_bytes(dataflash(replace(flight, rssi=np.full_like(flight.t, np.nan))))
    assert "no radio tells a level in it" in link(log, "--station", PLACE, status=2)


def test_a_throughput_and_a_ratio_to_the_noise_are_read_as_the_gain(tmp_path: Path) -> None:
    rates = tmp_path / "rates.csv"
    steps = np.arange(0.0, 60.0)
    rates.write_text("snr_db,mbit_per_s\n" + "".join(f"{x},{1 + x}\n" for x in steps))

    def throughput(dbm: Real) -> Real:
        return np.where(dbm < -100, 0.0, 1 + np.minimum(dbm + 100, 59.0))

    powers = ("--station", PLACE, "--power", 20)
    for column, of, more, lacking in (
        ("throughput_mbit_per_s", throughput, ("--rates", rates), "give --rates"),
        ("snr_db", lambda dbm: dbm + 100, (), "give both --power and --noise"),
    ):
        path = table(tmp_path, record(60.0), column, of)
        told = json.loads(link(path, *powers, "--noise", -100, *more, "--json"))
        assert told["reference_gain_db"] == pytest.approx(LAW[0], abs=1.5)
        assert lacking in link(path, *powers, status=2)
