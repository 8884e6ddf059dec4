"""A mock autopilot to test ground stations against."""

from faao_mav.mavlink.mock.autopilot import Fly, MockAutopilot
from faao_mav.mavlink.mock.manners import COUNT, Manners, MockKind, ardupilot, manners_of, px4

__all__ = ["COUNT", "Fly", "Manners", "MockAutopilot", "MockKind", "ardupilot", "manners_of", "px4"]
