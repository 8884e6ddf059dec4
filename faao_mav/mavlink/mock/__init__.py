"""A mock autopilot to test ground stations against."""

from faao_mav.mavlink.mock.behaviour import COUNT, Behaviour, MockKind, behaviour_of
from faao_mav.mavlink.mock.mock_autopilot import Fly, MockAutopilot

__all__ = ["COUNT", "Behaviour", "Fly", "MockAutopilot", "MockKind", "behaviour_of"]
