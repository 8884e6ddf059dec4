"""Flights from logs: of real autopilots in their simulators, and of files that are none.

`tests/data/logs` has one mission as ArduCopter 4.7 logged it (`arducopter.bin`: every other POS,
every 50th XKF2, the parameters that missions are timed for) and as `fly --log` did
(`arducopter.tlog`: positions only), and `px4.tlog`, of the same plan flown by PX4 1.16. The
`.ulg` files here are written by hand, after the ULog file format, with the positions of `px4.tlog`;
`tests/autopilots/test_fly.py` debriefs the log of a real PX4.
"""

import json
import struct
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import edited
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from faao_mav.cli.main import app
from faao_mav.errors import InputError
from faao_mav.mavlink.flying.logs import read_log
from faao_mav.mavlink.flying.record import FlightRecord
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.solution import save_solution
from faao_mav.plan import parse_plan

LOGS = Path(__file__).parent.parent / "data" / "logs"
PLAN = LOGS / "plan.yaml"


@pytest.fixture(scope="module")
def solutions(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The solved plan, for each autopilot."""
    folder, found = tmp_path_factory.mktemp("solutions"), {}
    for autopilot in ("ardupilot", "px4"):
        found[autopilot] = folder / f"{autopilot}.npz"
        plan = parse_plan(edited(PLAN.read_text(), {"vehicle.autopilot": autopilot}))
        save_solution(optimize(plan), found[autopilot])
    return found


def debriefed(log: Path, solution: Path, *more: str) -> dict[str, Any]:
    arguments = ["debrief", str(log), "--solution", str(solution), "--json", *more]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    told: dict[str, Any] = json.loads(result.stdout)
    return told


def ulog(record: FlightRecord, *, wind: tuple[float, float] | None = None) -> bytes:
    """Return a `.ulg` file: https://docs.px4.io/main/en/dev_log/ulog_file_format."""

    def message(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<H", len(content)) + kind + content

    formats = {
        "vehicle_global_position": "uint64_t timestamp;double lat;double lon;float alt;",
        "home_position": "uint64_t timestamp;float alt;",
        "wind": "uint64_t timestamp;float windspeed_north;float windspeed_east;",
    }
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", int(record.t[0] * 1e6))
    out += message(b"B", bytes(40))
    for name, fields in formats.items():
        out += message(b"F", f"{name}:{fields}".encode())
    parameter = b"float MPC_XY_CRUISE"
    out += message(b"P", bytes([len(parameter)]) + parameter + struct.pack("<f", 6.0))
    for number, name in enumerate(formats):
        out += message(b"A", struct.pack("<BH", 0, number) + name.encode())
    start = int(record.t[0] * 1e6)
    out += message(b"D", struct.pack("<HQf", 1, start, 584.0))
    rows = zip(record.t, record.latitude, record.longitude, record.height, strict=True)
    for t, latitude, longitude, height in rows:
        time = round(t * 1e6)
        place = struct.pack("<HQddf", 0, time, latitude, longitude, 584.0 + height)
        out += message(b"D", place)
        if wind is not None:
            out += message(b"D", struct.pack("<HQff", 2, time, wind[1], wind[0]))
    return out


def test_both_logs_of_a_flight_tell_the_same(solutions: dict[str, Path]) -> None:
    own, heard = (
        debriefed(LOGS / f"arducopter.{kind}", solutions["ardupilot"]) for kind in ("bin", "tlog")
    )
    for name in ("rate_bs_uav", "rate_uav_user", "delivered_rate", "duration"):
        assert own["flown"][name] == pytest.approx(heard["flown"][name], rel=1e-3)
    off = heard["flown"]["rms_position_error"]
    assert own["flown"]["rms_position_error"] == pytest.approx(off, abs=0.1)
    assert off < 3
    assert own["flown"]["delivered_rate"] == pytest.approx(
        own["planned"]["delivered_rate"], rel=2e-3
    )
    assert "WPNAV_SPEED" not in own["parameters"]
    assert own["wind"] is None
    assert own["missing"] == 0


def test_px4s_log_tells_what_was_heard(solutions: dict[str, Path], tmp_path: Path) -> None:
    heard = read_log(LOGS / "px4.tlog")
    log = tmp_path / "flight.ulg"
    log.write_bytes(ulog(heard, wind=(3.0, -4.0)))
    own = debriefed(log, solutions["px4"], "--report", str(tmp_path / "page.html"))
    told = debriefed(LOGS / "px4.tlog", solutions["px4"])
    for name, value in told["flown"].items():
        assert own["flown"][name] == (value if value is None else pytest.approx(value, rel=1e-4))
    assert own["altitude_error"] == pytest.approx(told["altitude_error"], abs=0.01)
    assert own["wind"] == pytest.approx([3.0, -4.0])
    page = (tmp_path / "page.html").read_text()
    assert "5.0 m/s from 323 degrees" in page
    assert "Distance from the planned place at equal times, as predicted and as flown" in page


def test_parameters_other_than_the_missions_are_told(
    solutions: dict[str, Path], tmp_path: Path
) -> None:
    log = tmp_path / "flight.bin"
    data = (LOGS / "arducopter.bin").read_bytes()
    assert data.count(struct.pack("<f", 600.0)) >= 1
    log.write_bytes(data.replace(struct.pack("<f", 600.0), struct.pack("<f", 900.0)))
    told = debriefed(log, solutions["ardupilot"])["parameters"]
    assert told["WPNAV_SPEED"] == [900.0, 600.0]


def test_a_log_that_ends_in_the_middle_is_told_as_far_as_it_goes(
    solutions: dict[str, Path], tmp_path: Path
) -> None:
    record = read_log(LOGS / "px4.tlog")
    whole = debriefed(LOGS / "px4.tlog", solutions["px4"])
    cut = tmp_path / "cut.ulg"
    upto = record.t < whole["start"] + 40
    cut.write_bytes(ulog(kept(record, upto)))
    found = debriefed(cut, solutions["px4"])
    assert found["start"] == pytest.approx(whole["start"], abs=0.02)
    assert found["missing"] == pytest.approx(60 - 0.5 - 40, abs=0.5)
    before = tmp_path / "before.ulg"
    before.write_bytes(ulog(kept(record, record.t < whole["start"])))
    arguments = ["debrief", str(before), "--solution", str(solutions["px4"])]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 1
    assert "the plan's flight is not in it" in result.output


def kept(record: FlightRecord, which: Any) -> FlightRecord:
    columns = (record.t, record.latitude, record.longitude, record.height)
    return FlightRecord(*(column[which] for column in columns))


def test_boots_in_one_log_stand_one_after_the_other(tmp_path: Path) -> None:
    once = (LOGS / "px4.tlog").read_bytes()
    log = tmp_path / "twice.tlog"
    log.write_bytes(once + once)
    record = read_log(log)
    alone = read_log(LOGS / "px4.tlog")
    assert len(record.t) == 2 * len(alone.t)
    assert (np.diff(record.t) > 0).all()
    assert np.diff(record.t).max() > 900


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("flight.log", b"", "give a flight log: .bin, .tlog, .ulg"),
        ("flight.bin", b"", "empty"),
        ("flight.bin", b"no log at all" * 100, "not a .bin log|0 positions"),
        ("flight.tlog", b"no log at all" * 100, "0 positions|not a .tlog log"),
        ("flight.ulg", b"no log at all" * 100, "not a .ulg log"),
        ("flight.ulg", b"", "not a .ulg log"),
    ],
)
def test_what_is_no_log_is_told(tmp_path: Path, name: str, content: bytes, told: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=told):
        read_log(path)
    with pytest.raises(InputError, match="no such file"):
        read_log(tmp_path / f"missing{path.suffix if path.suffix != '.log' else '.bin'}")


@cache
def contents() -> dict[str, bytes]:
    return {
        ".bin": (LOGS / "arducopter.bin").read_bytes()[:6000],
        ".tlog": (LOGS / "px4.tlog").read_bytes()[:3000],
        ".ulg": ulog(kept(read_log(LOGS / "px4.tlog"), slice(0, 60))),
    }


@given(
    kind=st.sampled_from([".bin", ".tlog", ".ulg"]),
    place=st.floats(0, 1),
    bytes_=st.binary(min_size=1, max_size=20),
    end=st.floats(0, 1),
)
def test_damaged_logs_are_read_or_told(
    tmp_path_factory: pytest.TempPathFactory, kind: str, place: float, bytes_: bytes, end: float
) -> None:
    data = bytearray(contents()[kind])
    at = int(place * len(data))
    data[at : at + len(bytes_)] = bytes_
    path = tmp_path_factory.getbasetemp() / f"damaged{kind}"
    path.write_bytes(data[: int(len(data) * max(end, 0.05))])
    try:
        record = read_log(path)
    except InputError:
        return
    assert (np.diff(record.t) > 0).all()
