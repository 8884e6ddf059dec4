"""How long transfers take over links of all kinds, and how much they send: on a simulated clock."""

import pytest
from stations import there_and_back

from faao_mav.sim import MockKind
from faao_mav.sim.faults import Faults

KINDS = pytest.mark.parametrize("kind", ["ardupilot", "px4"])


@KINDS
def test_300_items_over_a_quick_link(kind: MockKind) -> None:
    for loss, seconds, messages in ((0.0, 3, 1), (0.05, 6, 1.3), (0.2, 30, 2)):
        courses = there_and_back(kind, 300, Faults(loss=loss, seed=0))
        assert sum(course.took for course in courses) < seconds
        for course in courses:
            assert course.status in ("accepted", "unknown")
            assert max(course.ours, course.theirs) <= messages * 300


@KINDS
@pytest.mark.parametrize(
    "faults",
    [
        Faults(latency=0.1),
        Faults(latency=0.15, reordering=1.0, delay=0.1, seed=1),
        Faults(latency=0.5),
        Faults(latency=0.03, rate=5760.0),  # 57600 baud
        Faults(latency=0.1, rate=960.0),  # 9600 baud
    ],
    ids=str,
)
def test_a_slow_link_is_not_flooded(kind: MockKind, faults: Faults) -> None:
    up, back = there_and_back(kind, 100, faults)
    # A late request ends a download of PX4, which begins anew.
    late = kind == "px4" and faults.delay > 0
    assert back.ours <= (1.7 if late else 1.2) * 100
    # PX4 asks again after 0.25 s, ArduPilot after 1 s, and is answered each time.
    assert up.ours <= (2.1 if faults.latency >= 0.5 else 1.2) * up.theirs
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
