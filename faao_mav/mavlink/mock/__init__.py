"""A mock autopilot to test ground stations against."""

from faao_mav.mavlink.mock.firmware import COUNT, Behaviour
from faao_mav.mavlink.mock.kinds import MockKind, behaviour_of
from faao_mav.mavlink.mock.mock_autopilot import Fly, MockAutopilot

__all__ = ["COUNT", "Behaviour", "Fly", "MockAutopilot", "MockKind", "behaviour_of"]
