"""How a PX4 multicopter flies a mission.

The chain is PX4's own: `guidance` asks for a velocity, `smoothing` follows it within jerk and
acceleration, `response` is the aircraft that follows the smoothed trajectory, `step` takes the
three a moment further, and `simulation` flies leg after leg. Source: behaviour of PX4's modules
navigator and flight_mode_manager (FlightTaskAuto) and its library motion_planning, read at several
revisions about 1.16; controller gains are PX4's documented defaults. Flights: PX4 1.16 in
simulation.
"""

from faao_mav.vehicle.px4.model import Px4

__all__ = ["Px4"]
