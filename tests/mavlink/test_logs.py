"""Flights from logs: of real autopilots in their simulators, and of files that are none.

`tests/data/logs` has one mission as ArduCopter 4.7 logged it (`arducopter.bin`: every other POS,
every 50th XKF2, the parameters that missions are timed for) and as `fly --log` did
(`arducopter.tlog`: positions only), and `px4.tlog`, of the same plan flown by PX4 1.16. The
`.ulg` files here are made by `tests/ulog.py` with the positions of `px4.tlog`;
`tests/autopilots/test_fly.py` debriefs the log of a real PX4.
"""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import edited
from pymavlink import mavutil
from typer.testing import CliRunner
from ulog import kept, ulog

from faao_mav.cli.main import app
from faao_mav.errors import InputError
from faao_mav.mavlink.flying.log_messages import bin_messages, tlog_messages
from faao_mav.mavlink.flying.logs import read_log
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


@pytest.mark.parametrize(
    ("log", "read", "names"),
    [
        ("arducopter.bin", bin_messages, ["POS", "XKF2", "PARM"]),
        ("px4.tlog", tlog_messages, ["GLOBAL_POSITION_INT"]),
    ],
)
def test_messages_are_those_that_pymavlink_reads(log: str, read: Any, names: list[str]) -> None:
    theirs = mavutil.mavlink_connection(str(LOGS / log))
    for found in read(LOGS / log, names):
        name, values = found if isinstance(found, tuple) else (found.get_type(), found.to_dict())
        expected = theirs.recv_match(type=names).to_dict()
        assert name == expected.pop("mavpackettype")
        assert values.pop("Name", None) == expected.pop("Name", None)
        values.pop("mavpackettype", None)
        assert values == pytest.approx(expected, rel=1e-12, nan_ok=True)
    assert theirs.recv_match(type=names) is None
    (theirs.filehandle if log.endswith(".bin") else theirs).close()


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
        ("flight.bin", b"no log at all" * 100, "0 positions"),
        ("flight.bin", bytes(11_000_000), "more than 10,000,000 bytes that are no messages"),
        ("flight.tlog", b"no log at all" * 100, "0 positions"),
        ("flight.tlog", bytes(11_000_000), "more than 10,000,000 bytes that are no messages"),
        ("flight.tlog", b"\0" * 8 + b"\xfe\0\0\1\1\x21\0\0", "0 positions"),
        ("flight.tlog", (b"\0" * 8 + b"\xfe\0\0\1\1\x21\0\0") * 11_000, "10,000 damaged messages"),
        ("flight.ulg", b"no log at all" * 100, "not a .ulg log"),
        ("flight.ulg", b"", "empty"),
    ],
)
def test_what_is_no_log_is_told(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, content: bytes, told: str
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=told):
        read_log(path)
    assert capfd.readouterr() == ("", "")
    with pytest.raises(InputError, match="no such file"):
        read_log(tmp_path / f"missing{path.suffix if path.suffix != '.log' else '.bin'}")
