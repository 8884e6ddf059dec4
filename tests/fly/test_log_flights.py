"""Flights made of what logs say: damaged values, homes that are set again, older messages."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.errors import InputError
from faao_mav.fly.log_flights import flights
from faao_mav.fly.log_messages import Said
from faao_mav.fly.record import FlightRecord

LOG = Path("flight")
Fields: TypeAlias = dict[str, float | str]
POSITIONS = 60
"""Twelve seconds of a flight."""


def bin_position(k: int, height: float, home: float) -> Said:
    place = {"Lat": -35.0 + 1e-6 * k, "Lng": 149.0, "Alt": home + height, "RelHomeAlt": height}
    return 0, 0, "POS", {"TimeUS": 1e8 + 2e5 * k, **place}


def tlog_position(k: int, height: float, home: float) -> Said:
    place = {"lat": -350_000_000 + 10 * k, "lon": 1_490_000_000, "alt": 1e3 * (home + height)}
    fields: Fields = {"time_boot_ms": 100_000 + 200 * k, **place, "relative_alt": 1e3 * height}
    return 0, 0, "GLOBAL_POSITION_INT", fields


def ulg_position(k: int, height: float, home: float) -> Said:
    place = {"lat": -35.0 + 1e-6 * k, "lon": 149.0, "alt": home + height}
    return 0, 0, "vehicle_global_position", {"timestamp": 1e8 + 2e5 * k, **place}


Position = Callable[[int, float, float], Said]
KINDS: tuple[Position, ...] = (bin_position, tlog_position, ulg_position)


def flight(said: Sequence[Said]) -> FlightRecord:
    (record,) = flights(LOG, said)
    return record


@given(
    kind=st.sampled_from(KINDS),
    damaged=st.sets(st.integers(0, POSITIONS // 4 - 1)),
    field=st.integers(0, 3),
    value=st.sampled_from([np.nan, np.inf, -np.inf, 1e300, -1e300, 1e15, -1e15, "text"]),
)
def test_a_damaged_position_is_left_out_and_no_other(
    kind: Position, damaged: set[int], field: int, value: float | str
) -> None:
    said = [kind(k, 20.0, 500.0) for k in range(POSITIONS)]
    for k in damaged:
        fields = said[4 * k + 2][3]
        fields[list(fields)[field]] = value
    home: list[Said] = [(0, 0, "home_position", {"alt": 500.0})] if kind is ulg_position else []
    record = flight(home + said)
    sound = [k for k in range(POSITIONS) if k % 4 != 2 or k // 4 not in damaged]
    left = np.round((record.t - 100.0) / 0.2).astype(int).tolist()
    assert set(sound) <= set(left)
    assert record.latitude == pytest.approx(-35.0 + 1e-6 * np.array(left), abs=1e-9)
    assert record.longitude == pytest.approx(149.0)
    assert record.height == pytest.approx(20.0)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("again", [10, 30, 50])
def test_heights_are_above_home_as_it_was_then(kind: Position, again: int) -> None:
    """Home is set 6 m higher at position `again`; the aircraft stays where it is."""
    homes: tuple[Fields, ...] = (
        {"alt": 500.0, "valid_alt": 1},
        {"alt": 999.0, "valid_alt": 0},
        {"alt": 506.0},
    )
    first, no_home, second = ((0, 0, "home_position", home) for home in homes)
    said: list[Said] = [first, *(kind(k, 20.0, 500.0) for k in range(again)), no_home, second]
    said += [kind(k, 14.0, 506.0) for k in range(again, POSITIONS)]
    if kind is not ulg_position:
        said = [each for each in said if each[2] != "home_position"]
    record = flight(said)
    assert len(record.t) == POSITIONS
    for k, height in ((again - 1, 20.0), (again, 14.0)):
        heights = record.height_above_home_at(float(record.t[k]) + 0.1)
        assert heights == pytest.approx(height)


def test_a_home_that_comes_late_or_never() -> None:
    said = [ulg_position(k, float(k), 500.0) for k in range(POSITIONS)]
    assert flight(said).height == pytest.approx(np.arange(POSITIONS))
    later: list[Said] = [*said[:20], (0, 0, "home_position", {"alt": 490.0}), *said[20:]]
    assert flight(later).height == pytest.approx(10.0 + np.arange(POSITIONS))


@pytest.mark.parametrize("column", ["RelHomeAlt", "RelAlt", "RelOriginAlt", None])
def test_positions_of_any_firmware_are_read(column: str | None) -> None:
    said = [bin_position(k, float(k), 500.0) for k in range(POSITIONS)]
    for *_, fields in said:
        height = fields.pop("RelHomeAlt")
        if column is not None:
            fields |= {"RelHomeAlt": np.nan, "RelOriginAlt": np.nan, column: height}
    assert flight(said).height == pytest.approx(np.arange(POSITIONS))


@pytest.mark.parametrize(
    ("winds", "mean"),
    [
        ([("wind", 2.0), ("wind_estimate", 9.0)], [2.0, 1.0]),
        ([("wind_estimate", 2.0)], [2.0, 1.0]),
        ([("wind", np.nan), ("estimator_wind", 2.0)], [2.0, 1.0]),
        ([("XKF2", 0.0), ("NKF2", 2.0)], [2.0, 1.0]),
        ([("XKF2", 2.0), ("NKF2", 9.0)], [2.0, 1.0]),
        ([("WIND_COV", 2.0)], [2.0, 1.0]),
        ([("WIND_COV", np.nan)], None),
        ([("XKF2", 0.0)], None),
        ([("XKF2", 1e30)], None),
    ],
)
def test_wind_is_of_the_first_that_estimates_it(
    winds: list[tuple[str, float]], mean: list[float] | None
) -> None:
    said: list[Said] = []
    for k in range(POSITIONS):
        said.append(bin_position(k, 20.0, 500.0))
        for name, wind in winds:
            east, north = FIELDS[name]
            said.append((0, 0, name, {east: wind, north: wind / 2}))
    found = flight(said).mean_wind(100.0, 12.0)
    assert found == (None if mean is None else pytest.approx(mean))


FIELDS = {
    "XKF2": ("VWE", "VWN"),
    "NKF2": ("VWE", "VWN"),
    "WIND_COV": ("wind_y", "wind_x"),
    **dict.fromkeys(
        ("wind", "wind_estimate", "estimator_wind"), ("windspeed_east", "windspeed_north")
    ),
}
"""Fields of winds towards east and north."""


def test_the_autopilot_of_a_system_counts() -> None:
    def said(system: int, component: int, height: float, count: int = POSITIONS) -> list[Said]:
        told = (tlog_position(k, height, 500.0) for k in range(count))
        return [(system, component, *each[2:]) for each in told]

    log = [*said(1, 191, 9.0), *said(1, 1, 1.0, 20), *said(2, 1, 2.0)]
    log += [*said(3, 1, 9.0, 5), *said(3, 5, 3.0), *said(3, 191, 9.0, 30)]
    found = {record.system: record.height.tolist() for record in flights(LOG, log)}
    assert found == {1: [1.0] * 20, 2: [2.0] * POSITIONS, 3: [3.0] * POSITIONS}
    assert [record.system for record in flights(LOG, log, 2)] == [2]
    with pytest.raises(InputError, match=r"--system 4: not in flight, where .* of: 1, 2, 3$"):
        flights(LOG, log, 4)


def test_a_clock_that_runs_for_days_is_refused() -> None:
    said = [bin_position(4500 * k, 20.0, 500.0) for k in range(POSITIONS + 50)]
    with pytest.raises(InputError, match="27 hours"):
        flight(said)
