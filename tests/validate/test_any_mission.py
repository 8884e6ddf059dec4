"""Any mission can be judged, for any vehicle."""

from dataclasses import replace

import hypothesis.strategies as st
from hypothesis import given, settings
from judged import VEHICLES, track
from random_missions import missions

from faao_mav.mission.item import Mission
from faao_mav.validate import Limits, ValidationContext, validate

ZEROS = ("WPNAV_SPEED", "WPNAV_ACCEL", "WPNAV_JERK", "MPC_ACC_HOR", "MPC_JERK_AUTO", "NAV_ACC_RAD")
STRICT = dict.fromkeys(ZEROS, 0.0) | {
    "ARMING_MIS_ITEMS": 127.0,
    "FENCE_ENABLE": 1.0,
    "FENCE_TYPE": 15.0,
    "MIS_TKO_LAND_REQ": 3.0,
    "GF_MAX_HOR_DIST": 10.0,
    "GF_MAX_VER_DIST": 10.0,
}
LIMITS = Limits(1.0, 50.0, 20.0, 5.0, 2.0)


@given(mission=missions(sound=False), bare=st.booleans(), flown=st.booleans())
@settings(max_examples=30)
def test_any_mission_can_be_judged(mission: Mission, bare: bool, flown: bool) -> None:
    flight = track(((0, 0, 0), (0, 0, 30), (0, 90, 30)), [0, 1], 5.0)
    known = flight if flown and len(mission.items) >= 2 else None
    for vehicle in VEHICLES:
        judged = vehicle if bare else replace(vehicle, parameters=STRICT)
        limits = Limits() if bare else LIMITS
        found = validate(ValidationContext(mission, judged, known, limits))
        for finding in found:
            assert finding.item is None or 1 <= finding.item <= len(mission.items)
