"""Any mission is read back as it was written; what is not is told."""

import dataclasses
import math

from hypothesis import given
from hypothesis import strategies as st
from random_missions import missions

from faao_mav.mission import Home, Mission, MissionItem
from faao_mav.mission.formats import PlanTarget, render_files, write_qgc_plan
from faao_mav.mission.formats.qgc_plan import read_qgc_plan
from faao_mav.mission.formats.wpl import read_wpl, read_wpl_fence, write_wpl, write_wpl_fence

PX4, ARDUPILOT = PlanTarget(12, 2), PlanTarget(3, 2, takes_null=False)


def zeroed(mission: Mission) -> tuple[MissionItem, ...]:
    """Return the items of `mission` with 0 for what is not set."""

    def item(each: MissionItem) -> MissionItem:
        a, b, c, d, x, y, z = (0.0 if math.isnan(value) else value for value in each.numbers)
        return dataclasses.replace(each, params=(a, b, c, d), x=x, y=y, z=z)

    return tuple(map(item, mission.items))


@given(missions(), st.sampled_from([PX4, None, ARDUPILOT]))
def test_a_plan_is_read_back_bit_for_bit(mission: Mission, target: PlanTarget | None) -> None:
    read = read_qgc_plan(write_qgc_plan(mission, target))
    check_told(mission, "x.plan", target, becomes_0=target is ARDUPILOT)
    if target is ARDUPILOT:  # which refuses null
        mission = dataclasses.replace(mission, items=zeroed(mission))
    # repr tells NaN and the sign of zero, which == does not.
    assert repr(dataclasses.astuple(read.mission)) == repr(dataclasses.astuple(mission))
    numbers = (target.firmware, target.vehicle_type) if target else (0, 0)
    assert (read.firmware, read.vehicle_type) == numbers


@given(missions())
def test_text_files_are_read_back_bit_for_bit(mission: Mission) -> None:
    read = read_wpl(write_wpl(mission)).mission
    check_told(mission, "x.txt", None, becomes_0=True)
    assert repr((read.items, read.home)) == repr((zeroed(mission), mission.home))
    bare = dataclasses.replace(mission.fence, breach_return=None)
    text = write_wpl_fence(dataclasses.replace(mission, fence=bare), "for m.waypoints")
    if bare:
        assert read_wpl_fence(text) == bare
    low = dataclasses.replace(mission, home=Home(1.0, 2.0, math.nan))
    assert "the altitude of home is not known: the file says 0 m" in render_files(low, "x.txt").lost


def check_told(mission: Mission, name: str, target: PlanTarget | None, *, becomes_0: bool) -> None:
    """Assert that what is written as 0 is told where there is any, and only there."""
    lost = render_files(mission, name, target).lost
    unset = any(math.isnan(value) for item in mission.items for value in item.numbers)
    assert (unset and becomes_0) == any("not set (NaN) becomes 0" in line for line in lost)
    assert any("no home is known" in line for line in lost) == (mission.home is None)
