"""A mock autopilot to test ground stations against."""

from faao_mav.sim.behaviour import COUNT as COUNT
from faao_mav.sim.behaviour import Behaviour as Behaviour
from faao_mav.sim.behaviour import MockKind as MockKind
from faao_mav.sim.behaviour import behaviour_of as behaviour_of
from faao_mav.sim.mock_autopilot import MockAutopilot as MockAutopilot
