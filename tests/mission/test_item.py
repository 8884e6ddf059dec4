"""Items and the numbers of commands and frames."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from faao_mav.errors import InputError
from faao_mav.mission import Command, Frame, Home, MissionItem


def test_commands_and_frames_have_mavlinks_numbers() -> None:
    for kind, prefix in ((Command, "MAV_CMD"), (Frame, "MAV_FRAME")):
        for each in kind:
            assert mavlink.enums[prefix][int(each)].name == f"{prefix}_{each.name}"


def test_what_is_impossible_is_refused() -> None:
    nan, inf = math.nan, math.inf
    for make, told in (
        (lambda: MissionItem(65_536, 3), "command 65536; expected 0 to 65535"),
        (lambda: MissionItem(16, -1), "frame -1; expected 0 to 255"),
        (lambda: MissionItem(16, 3, (0.0, 0.0, nan, inf)), "expected finite"),
        (lambda: MissionItem(16, 3, z=-inf), "expected finite"),
        (lambda: Home(91.0, 0.0, 0.0), "home"),
        (lambda: Home(0.0, 180.1, 0.0), "home"),
        (lambda: Home(0.0, 0.0, inf), "home"),
    ):
        with pytest.raises(InputError, match=told):
            make()
