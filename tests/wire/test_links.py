"""How long transfers take over links of all kinds, and how much they send: on a simulated clock."""

import pytest
from stations import mock_of, rows_for, there_and_back, upload_to

from faao_mav.sim import MockKind, behaviour_of
from faao_mav.sim.faults import Faults
from faao_mav.wire.protocol import MavResult, MissionType

KINDS = pytest.mark.parametrize("kind", ["ardupilot", "px4"])
REQUEST_INT = 51


@KINDS
def test_600_items_over_a_quick_link(kind: MockKind) -> None:
    for loss, seconds, messages in ((0.0, 5, 1), (0.05, 10, 1.3), (0.2, 60, 2)):
        courses = there_and_back(kind, 600, Faults(loss=loss, seed=0))
        assert sum(course.took for course in courses) < seconds
        for course in courses:
            assert course.status in ("accepted", "unknown")
            assert max(course.ours, course.theirs) <= messages * 600


SLOW = {
    "0.2 s there and back": Faults(latency=0.1),
    "0.3 to 0.5 s": Faults(latency=0.15, reordering=1.0, delay=0.1, seed=1),
    "0.1 to 0.3 s": Faults(latency=0.05, reordering=1.0, delay=0.1),
    "1 s": Faults(latency=0.5),
    "57600 baud": Faults(latency=0.03, rate=5760.0),
    "9600 baud": Faults(latency=0.1, rate=960.0),
}


@KINDS
@pytest.mark.parametrize("name", SLOW)
def test_a_slow_link_is_not_flooded(kind: MockKind, name: str) -> None:
    faults = SLOW[name]
    up, back = there_and_back(kind, 100, faults)
    # A late request ends a download of PX4, which begins anew.
    late = kind == "px4" and faults.delay > 0
    assert back.ours <= (1.7 if late else 1.2) * 100
    # PX4 asks again after 0.25 s, ArduPilot after 1 s, and is answered each time.
    assert up.ours <= (2.1 if faults.latency >= 0.5 else 1.2) * up.theirs
    assert up.theirs <= (1.1 if kind == "ardupilot" else 4.1) * 100
    lossy = Faults(loss=0.1, latency=faults.latency, rate=faults.rate, seed=1)
    up, back = there_and_back(kind, 100, lossy)
    assert back.ours <= 1.4 * 100
    assert up.ours <= 1.7 * max(up.theirs, 100)


@KINDS
def test_a_radio_that_is_busy_with_telemetry_is_not_flooded(kind: MockKind) -> None:
    """20 reports a second take two thirds of what this line can carry."""
    for course in there_and_back(kind, 100, Faults(latency=0.03, rate=2500.0), telemetry=20.0):
        assert course.ours <= 1.3 * 100
        assert course.took < 15


def test_ardupilot_is_read_several_rows_at_a_time_and_px4_is_not_waited_for() -> None:
    """Where it has lost a request: it would ask again after 0.25 s."""
    for loss in (0.0, 0.2):
        faults = Faults(latency=0.15, loss=loss, seed=2)
        one, several = (there_and_back(kind, 100, faults)[1] for kind in ("px4", "ardupilot"))
        assert several.took < one.took / 2.5
        assert several.ours < 1.1 * one.ours
    plain = there_and_back("px4", 30, Faults())[0].took
    lost = there_and_back("px4", 30, Faults(), lost=(REQUEST_INT, 12))[0].took
    assert plain < lost < plain + 0.1


@KINDS
def test_the_item_that_is_refused_is_named_whatever_is_lost(kind: MockKind) -> None:
    for seq, loss in ((5, 0.0), (6, 0.2), (7, 0.4)):
        refusals = {(MissionType.MISSION, seq): MavResult.INVALID_PARAM2}
        for seed in range(10):
            mock = mock_of(behaviour_of(kind, refusals=refusals))
            rows = rows_for(mock.vehicle.family.key, 12)[:12]
            report, _ = upload_to(mock, rows, Faults(loss=loss, seed=seed))
            assert not report.verified
            if report.result == MavResult.INVALID_PARAM2:
                assert report.item == seq
