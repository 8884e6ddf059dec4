"""What the files of missions and parameters say of a vehicle."""

import pytest

from faao_mav.autopilot.files import autopilot_of


@pytest.mark.parametrize(
    ("names", "whose"),
    [
        (["WPNAV_SPEED"], "ardupilot"),
        (["WP_SPD", "RTL_ALT"], "ardupilot"),
        (["RTL_RETURN_ALT", "MPC_XY_CRUISE"], "px4"),
        (["NAV_ACC_RAD"], "px4"),
        (["RTL_ALT"], None),
        (["MPC_XY_CRUISE", "WPNAV_SPEED"], None),
        ([], None),
    ],
)
def test_names_tell_whose_parameters_they_are(names: list[str], whose: str | None) -> None:
    assert autopilot_of(names) == whose
