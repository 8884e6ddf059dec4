"""How a PX4 multicopter flies a mission.

The chain is PX4's own: `guidance` asks for a velocity, `smoothing` follows it within jerk and
acceleration, `response` is the aircraft that follows the smoothed trajectory, and `simulation`
steps the three and switches waypoints. Source: PX4 1.16, modules navigator, flight_mode_manager
(FlightTaskAuto) and mc_pos_control, library motion_planning; read, not copied.
"""

from faao_mav.mission.flight.px4.model import Px4

__all__ = ["Px4"]
