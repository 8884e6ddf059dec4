"""A mock autopilot to test ground stations against."""

from dataclasses import replace
from typing import Any, Literal, TypeAlias

from faao_mav.sim.behaviour import COUNT as COUNT
from faao_mav.sim.behaviour import MOCK_ARDUPILOT, MOCK_PX4
from faao_mav.sim.behaviour import Behaviour as Behaviour
from faao_mav.sim.mock_autopilot import MockAutopilot as MockAutopilot

MockKind: TypeAlias = Literal["ardupilot", "px4", "px4-legacy-first"]

_BEHAVIOURS: dict[MockKind, Behaviour] = {
    "ardupilot": MOCK_ARDUPILOT,
    "px4": MOCK_PX4,
    "px4-legacy-first": replace(MOCK_PX4, legacy_first=True),
}


def behaviour_of(kind: MockKind, **changes: Any) -> Behaviour:
    """Return the behaviour of `kind`, with some fields changed.

    >>> behaviour_of("px4", complete_only=False).family.name
    'PX4'
    """
    return replace(_BEHAVIOURS[kind], **changes)
