"""Items and the numbers of commands and frames."""

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from faao_mav.errors import InputError
from faao_mav.mission import Command, Frame, Home, MissionItem


def test_commands_and_frames_have_mavlinks_numbers() -> None:
    for kind, prefix in ((Command, "MAV_CMD"), (Frame, "MAV_FRAME")):
        for each in kind:
            assert mavlink.enums[prefix][int(each)].name == f"{prefix}_{each.name}"


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"command": 65_536}, "command 65536; expected 0 to 65535"),
        ({"frame": -1}, "frame -1; expected 0 to 255"),
        ({"params": (0.0, 0.0, 0.0)}, "3 parameters; expected 4"),
        ({"params": (math.inf, 0.0, 0.0, 0.0)}, "expected finite"),
        ({"params": (0.0, 0.0, 0.0, math.inf)}, "expected finite"),
        ({"z": -math.inf}, "expected finite"),
    ],
)
def test_an_impossible_item_is_refused(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        MissionItem(**({"command": 16, "frame": 3} | fields))


def test_yaw_may_be_not_set() -> None:
    assert math.isnan(MissionItem(16, 3, (0.0, 0.0, 0.0, math.nan)).params[3])


@pytest.mark.parametrize("home", [(91.0, 0.0, 0.0), (0.0, 180.1, 0.0), (0.0, 0.0, math.inf)])
def test_an_impossible_home_is_refused(home: tuple[float, float, float]) -> None:
    with pytest.raises(InputError, match="home"):
        Home(*home)
