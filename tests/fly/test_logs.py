"""Flights from logs: of real autopilots in their simulators, and of files that are none.

`tests/data/logs` has one mission as ArduCopter 4.7 logged it (`arducopter.bin`: every other POS,
every 50th XKF2, the parameters that missions are timed for) and as `fly --log` did
(`arducopter.tlog`: positions only), and `px4.tlog`, of the same plan flown by PX4 1.16. Other logs
are made by `tests/flight_logs.py` with these positions; `tests/real_autopilots/test_fly.py`
debriefs the log of a real PX4.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from conftest import edited
from flight_logs import dataflash, heard, heights, kept, tlog, ulog
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.errors import FaaoError, InputError
from faao_mav.fly import logs
from faao_mav.fly.logs import _TOLD, Said, flights, messages, read_log
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.problem import build_problem
from faao_mav.plan import parse_plan
from faao_mav.report.debrief import FromLog
from faao_mav.report.page import render_report
from faao_mav.validate.flown import FlightRecord
from faao_mav.workflow import Result, with_mission

LOGS = Path(__file__).parent.parent / "data" / "logs"
PLAN = (LOGS / "plan.yaml").read_text()


@cache
def planned(autopilot: str) -> Result:
    """Return the solved plan and its mission, for an autopilot."""
    plan = parse_plan(edited(PLAN, {"vehicle.autopilot": autopilot}))
    if autopilot == "ardupilot":
        return with_mission(Result(optimize(plan)))
    solution = planned("ardupilot").solution  # the flight does not depend on it
    return with_mission(Result(replace(solution, problem=build_problem(plan))))


def records(log: Path, system: int = 0) -> list[FlightRecord]:
    """Return the flights in a log, as `read_log` does in a process of its own."""
    return [FlightRecord.of(*each) for each in flights(log, messages(log), system)]


def debriefed(log: Path, autopilot: str, system: int = 0) -> FromLog:
    return FromLog.of(records(log, system), planned(autopilot), str(log))


@cache
def flown() -> FlightRecord:
    """Return the flight in `px4.tlog`."""
    return records(LOGS / "px4.tlog")[0]


@pytest.fixture(scope="module")
def flight() -> FlightRecord:
    """The flight in `px4.tlog`, of which every other position is enough."""
    return kept(flown(), slice(None, None, 2))


def test_both_logs_of_a_flight_tell_the_same() -> None:
    kinds = ("bin", "tlog")
    own, told = (debriefed(LOGS / f"arducopter.{x}", "ardupilot").as_dict() for x in kinds)
    for name in ("rate_bs_uav", "rate_uav_user", "delivered_rate", "duration"):
        assert own["flown"][name] == pytest.approx(told["flown"][name], rel=1e-3)
    off = told["flown"]["rms_position_error"]
    assert own["flown"]["rms_position_error"] == pytest.approx(off, abs=0.1)
    assert off < 3
    planned_rate = own["planned"]["delivered_rate"]
    assert own["flown"]["delivered_rate"] == pytest.approx(planned_rate, rel=2e-3)
    assert "WPNAV_SPEED" not in own["parameters"]
    assert own["wind"] is None  # ArduCopter that is not told its drag logs zeros
    assert own["missing"] == 0


def test_px4s_log_tells_what_was_heard(tmp_path: Path) -> None:
    log, conversion = tmp_path / "flight.ulg", planned("px4").conversion
    assert conversion is not None
    name, due = next(iter(conversion.parameters.items()))
    wind = np.tile([3.0, -4.0], (len(flown().t), 1))
    parameters = {**conversion.parameters, name: due + 1}
    log.write_bytes(ulog(flown(), wind=wind, parameters=parameters))
    found = debriefed(log, "px4")
    own, told = found.as_dict(), debriefed(LOGS / "px4.tlog", "px4").as_dict()
    for key, value in told["flown"].items():
        assert own["flown"][key] == (value if value is None else pytest.approx(value, rel=1e-4))
    assert own["wind"] == pytest.approx([3.0, -4.0])
    assert own["parameters"] == {name: (pytest.approx(due + 1), due)}
    assert (own["system"], told["system"]) == (None, 1)
    page = render_report(found, title="flight")
    assert "5.0 m/s from 323 degrees" in page
    assert "Distance from the planned place at equal times, as predicted and as flown" in page


def test_what_a_radio_counted_is_compared_with_the_planned_gains(tmp_path: Path) -> None:
    """Levels that are 4 dB above and below d^-2 from the base station are that far from it."""
    solution = planned("px4").solution
    line = flown().line(solution)
    away = np.hypot(*(line.w - np.array(solution.plan.radio.base_station.position)).T)
    count = np.arange(len(away))
    level = -20 * np.log10(np.hypot(away, line.up)) + 4.0 * (-1) ** (count // 5)
    rssi = np.where(count % 5 == 0, np.round(150 + 1.9 * level), np.nan)
    log = tmp_path / "flight.tlog"
    log.write_bytes(tlog(heard(replace(flown(), rssi=rssi))))
    told = debriefed(log, "px4").as_dict()["radio"]
    assert told["levels"] > 50
    assert told["base_station_db"] == pytest.approx(4.0, abs=0.3)
    assert debriefed(LOGS / "px4.tlog", "px4").as_dict()["radio"] is None


def test_a_log_that_ends_in_the_middle_is_told_as_far_as_it_goes(
    flight: FlightRecord, tmp_path: Path
) -> None:
    start = debriefed(LOGS / "px4.tlog", "px4").found.start
    cut = tmp_path / "cut.ulg"
    cut.write_bytes(ulog(kept(flight, flight.t < start + 40)))
    found = debriefed(cut, "px4").found
    assert found.start == pytest.approx(start, abs=0.02)
    assert found.missing == pytest.approx(60 - 0.5 - 40, abs=0.5)
    until = found.solution.relayed.forwarded[: round(40 / 0.5)].sum()
    assert found.seen == pytest.approx(until / found.solution.relayed.forwarded.sum(), rel=0.02)
    assert not found.broken_off
    cut.write_bytes(ulog(kept(flight, flight.t < start)))
    with pytest.raises(FaaoError, match="the plan's flight is not in it"):
        debriefed(cut, "px4")
    log = tmp_path / "cut.tlog"  # in the first message of its kind
    wind = heard(kept(flight, [-1]), wind=np.ones((1, 2)))[1:]
    log.write_bytes(tlog(heard(flight), wind)[:-5])
    assert len(read_log(log)[0].t) == len(flight.t)


@pytest.mark.parametrize("kind", ["bin", "tlog", "ulg"])
def test_every_kind_of_log_tells_the_flight(
    kind: str, flight: FlightRecord, tmp_path: Path
) -> None:
    wind = np.tile([2.0, 1.0], (len(flight.t), 1))
    wind[::3] = np.nan
    wind[1::7] = np.inf
    wind[2::7, 0] = -1e30
    parameters = {"SPEED": 6.0, "BROKEN": float("nan")}
    rssi = np.where(np.arange(len(flight.t)) % 4 == 1, 150.0, np.nan)
    rssi[5] = 255.0  # not known
    flight = replace(flight, rssi=rssi)
    writers: dict[str, Callable[..., bytes]] = {"bin": dataflash, "ulg": ulog}
    writer = writers.get(kind, lambda *given, **more: tlog(heard(*given, **more)))
    log = tmp_path / f"flight.{kind.upper()}"
    log.write_bytes(writer(flight, wind=wind, parameters=parameters))
    (record,) = records(log)
    assert record.t == pytest.approx(flight.t, abs=1e-6)
    for name in ("latitude", "longitude"):
        assert getattr(record, name) == pytest.approx(getattr(flight, name), abs=1e-7)
    assert heights(record) == pytest.approx(heights(flight), abs=2e-3)
    assert record.parameters == {"SPEED": 6.0}
    np.testing.assert_array_equal(record.rssi, np.where(rssi == 150.0, rssi, np.nan))
    assert record.mean_wind(record.t[0], 1e3) == pytest.approx([2.0, 1.0])


def test_the_vehicle_whose_flight_is_the_plans(flight: FlightRecord, tmp_path: Path) -> None:
    idle = replace(flight, latitude=flight.latitude + 0.01, altitude=flight.home)
    wind = np.tile([5.0, 5.0], (len(flight.t), 1))
    log = tmp_path / "two.tlog"
    log.write_bytes(
        tlog(
            heard(idle, sender=(7, 1), wind=2 * wind, delay=-0.01),
            heard(kept(idle, slice(5)), sender=(2, 0), wind=wind[:5]),
            heard(kept(flight, flight.t > 0), sender=(2, 191), wind=wind, delay=-0.005),
            heard(flight, sender=(2, 1)),
        )
    )
    told = debriefed(log, "px4")
    assert (told.as_dict()["system"], told.as_dict()["wind"]) == (2, None)
    assert ("vehicle", "system 2, by its flight; also in the log: 7") in [*told.lines()]
    assert len(debriefed(log, "px4", 2).records) == 1
    with pytest.raises(FaaoError, match="the plan's flight is not in it"):
        debriefed(log, "px4", 7)
    with pytest.raises(InputError, match="--system 3: not in"):
        debriefed(log, "px4", 3)


def test_boots_in_one_log_stand_one_after_the_other(tmp_path: Path) -> None:
    once = (LOGS / "px4.tlog").read_bytes()
    log = tmp_path / "twice.tlog"
    log.write_bytes(once + once)
    (record,) = records(log)
    assert len(record.t) == 2 * len(flown().t)
    assert (np.diff(record.t) > 0).all()
    assert np.diff(record.t).max() > 900


def test_what_is_no_log_is_told(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for name, content, told in (
        ("flight.bin", None, "no such file"),
        ("flight.csv", b"1,2", "give a flight log: .bin, .tlog, .ulg"),
        ("flight.bin", b"", "empty"),
        ("flight.bin", b"no log at all" * 100, "0 positions"),
        ("flight.ulg", b"no log at all" * 100, "not a .ulg log"),
    ):
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(InputError, match=told):
            read_log(path)
        assert capfd.readouterr() == ("", "")


def test_reading_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "zeros.bin"
    path.write_bytes(bytes(1000))
    monkeypatch.setattr(logs, "_PATIENCE", 1e-3)  # no process begins as soon
    with pytest.raises(InputError, match=r"not read within 0\.001 s"):
        read_log(path)
    monkeypatch.setattr(logs, "_LARGEST", 999)
    with pytest.raises(InputError, match="larger than 999 bytes"):
        read_log(path)
    monkeypatch.setattr(logs, "_MOST_MESSAGES", 800)
    with pytest.raises(InputError, match="more than 800 positions"):
        flights(path, messages(LOGS / "arducopter.tlog"))


def test_no_code_of_the_current_directory_is_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("json", "numpy", "pymavlink", "resource", "faao_mav"):
        (tmp_path / f"{name}.py").write_text("open('run', 'w')")
    (tmp_path / "flight.TLOG").write_bytes((LOGS / "px4.tlog").read_bytes())
    monkeypatch.chdir(tmp_path)
    assert len(read_log(Path("flight.TLOG"))[0].t) > 100
    assert not Path("run").exists()


# ---- what logs say, message by message

POSITIONS = 60
"""Twelve seconds of a flight."""

KINDS = ("POS", "GLOBAL_POSITION_INT", "vehicle_global_position")


def position(name: str, k: int, height: float, home: float) -> Said:
    """Return what a message of the kind `name` says of the flight after `k` fifths of a second."""
    values = (100.0 + 0.2 * k, -35.0 + 1e-6 * k, 149.0, home + height, height)
    fields = zip(_TOLD[name][1].items(), values, strict=False)
    return 0, 0, name, {field: unit * value for (field, unit), value in fields}


def made_of(said: Sequence[Said]) -> FlightRecord:
    (flown,) = flights(Path("flight"), said)
    return FlightRecord.of(*flown)


@given(
    kind=st.sampled_from(KINDS),
    damaged=st.sets(st.integers(0, POSITIONS // 4 - 1)),
    field=st.integers(0, 3),
    value=st.sampled_from([np.nan, np.inf, -np.inf, 1e300, -1e300, 1e15, -1e15, "text"]),
)
def test_a_damaged_position_is_left_out_and_no_other(
    kind: str, damaged: set[int], field: int, value: float | str
) -> None:
    said = [position(kind, k, 20.0, 500.0) for k in range(POSITIONS)]
    for k in damaged:
        _, _, name, fields = said[4 * k + 2]
        said[4 * k + 2] = 0, 0, name, {**fields, list(fields)[field]: value}
    record = made_of([(0, 0, "home_position", {"alt": 500.0}), *said])
    left = [k for k in range(POSITIONS) if k % 4 != 2 or k // 4 not in damaged]
    assert record.t == pytest.approx(100.0 + 0.2 * np.array(left))
    assert record.latitude == pytest.approx(-35.0 + 1e-6 * np.array(left), abs=1e-9)
    assert heights(record) == pytest.approx(20.0)


@pytest.mark.parametrize("kind", KINDS)
def test_heights_are_above_home_as_it_was_then(kind: str) -> None:
    """Home is set 6 m higher in the middle; the aircraft stays where it is."""
    homes = ({"alt": 500.0, "valid_alt": 1}, {"alt": 999.0, "valid_alt": 0}, {"alt": 506.0})
    first, none, second = ((0, 0, "home_position", home) for home in homes)
    low = [position(kind, k, 20.0, 500.0) for k in range(30)]
    high = [position(kind, k, 14.0, 506.0) for k in range(30, POSITIONS)]
    record = made_of([first, *low, none, second, *high])
    assert record.altitude == pytest.approx(520.0)
    assert record.home[[29, 30]] == pytest.approx([500.0, 506.0])


def test_a_home_that_comes_late_or_never_and_a_clock_that_runs_for_days() -> None:
    said = [position(KINDS[2], k, float(k), 500.0) for k in range(POSITIONS)]
    assert heights(made_of(said)) == pytest.approx(np.arange(POSITIONS))
    later: list[Said] = [*said[:20], (0, 0, "home_position", {"alt": 490.0}), *said[20:]]
    assert heights(made_of(later)) == pytest.approx(10.0 + np.arange(POSITIONS))
    said = [position(KINDS[0], 4500 * k, 20.0, 500.0) for k in range(POSITIONS + 50)]
    with pytest.raises(InputError, match="27 hours"):
        made_of(said)
