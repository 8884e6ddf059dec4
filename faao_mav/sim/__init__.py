"""A mock autopilot to test ground stations against."""

from dataclasses import replace
from typing import Any, Literal, TypeAlias

from faao_mav.sim.ardupilot_firmware import ArduPilotFirmware
from faao_mav.sim.firmware import COUNT as COUNT
from faao_mav.sim.firmware import Behaviour as Behaviour
from faao_mav.sim.mock_autopilot import MockAutopilot as MockAutopilot
from faao_mav.sim.px4_firmware import Px4Firmware

MockKind: TypeAlias = Literal["ardupilot", "px4", "px4-legacy-first"]

_BEHAVIOURS: dict[MockKind, Behaviour] = {
    "ardupilot": Behaviour(ArduPilotFirmware, legacy_first=True),
    "px4": Behaviour(Px4Firmware),
    "px4-legacy-first": Behaviour(Px4Firmware, legacy_first=True),
}


def behaviour_of(kind: MockKind, **changes: Any) -> Behaviour:
    """Return the behaviour of `kind`, with some fields changed.

    >>> behaviour_of("px4", complete_only=False).family.name
    'PX4'
    """
    return replace(_BEHAVIOURS[kind], **changes)
