"""What people call the flight mode that a heartbeat tells."""

from dataclasses import astuple

from faao_mav.wire.messages import Heartbeat


def mode_name(heartbeat: Heartbeat) -> str:
    """Return what people call the mode that `heartbeat` tells.

    >>> mode_name(Heartbeat(type=2, autopilot=3, base_mode=1, custom_mode=17, system_status=4))
    'BRAKE'
    """
    from pymavlink.dialects.v20.development import MAVLink_heartbeat_message
    from pymavlink.mavutil import mode_string_v10

    return str(mode_string_v10(MAVLink_heartbeat_message(*astuple(heartbeat))))
