"""What autopilots do with items; what is refused with a rule of its own is in `limits.tsv`."""

import math
from pathlib import Path

import pytest
from judged import COPTER, PLANE, PX4, at, given

from faao_mav.autopilot import Vehicle
from faao_mav.mission import MissionItem

STORED = Path(__file__).parents[1] / "data" / "validate" / "stored.tsv"


def test_what_is_kept_of_items() -> None:
    for line in STORED.read_text().splitlines()[1:]:
        case, expected = map(given, line.split("\t"))
        (sent,), (kept,), dialect = case.items, expected.items, case.vehicle.type.dialect
        assert dialect.refusal(sent) is None, line
        stored = dialect.stored(sent)
        assert (stored.command, stored.frame) == (kept.command, kept.frame), line
        assert (stored.x, stored.y) == (kept.x, kept.y), line
        assert stored.numbers == pytest.approx(kept.numbers, abs=1e-5, nan_ok=True), line


def refusal(item: MissionItem, vehicle: Vehicle = COPTER) -> str:
    return vehicle.type.dialect.refusal(item) or "taken"


def test_what_is_refused() -> None:
    for command, place, told in (
        *((command, 3, "taken") for command in (16, 21, 22, 84, 85)),  # as a yaw only
        *((16, k, f"NaN in param{k + 1}") for k in range(3)),
        *((command, 3, "NaN in param4") for command in (17, 19, 82)),
        *((command, 1, "NaN in param2") for command in (178, 85)),
    ):
        params = [math.nan if k == place else 0.0 for k in range(4)]
        assert told in refusal(at(0, 0, 3, *params, command=command)), (command, place)
    for vehicle, give in ((COPTER, "0, 2, 3, 5, 6, 10, 11"), (PX4, "0, 3, 5, 6")):
        for frame in {1, 2, 4, 7, 8, 10, 11} - {*map(int, give.split(", "))}:
            told = f"takes no NAV_WAYPOINT in frame {frame}; give one of {give}"
            assert told in refusal(at(0, 0, 9, frame=frame), vehicle)
    for command in (178, 20, 93, 177, 179):
        assert refusal(MissionItem(command, 2), PX4) == "taken"
        for frame in (0, 3, 5, 6):
            assert "give one of 2" in refusal(MissionItem(command, frame), PX4)
    for item, part in (
        (MissionItem(16, 3, x=91.0), "latitude 91"),
        (MissionItem(16, 3, y=math.nan), "longitude nan"),
        (at(0, 0, math.nan), "altitude nan"),
        (at(0, 0, 83_000.0), "below 83000"),
    ):
        assert part in refusal(item)
    assert refusal(at(0, 0, 3, command=82)) == "taken"
    assert "does not support NAV_SPLINE_WAYPOINT" in refusal(at(0, 0, 3, command=82), PLANE)
    for command in (18, 82, 92, 115):
        for frame in (2, 3):
            assert "does not support" in refusal(MissionItem(command, frame), PX4)
