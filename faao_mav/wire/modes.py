"""The flight modes that the package asks for, by the numbers that heartbeats carry."""

from collections.abc import Mapping
from dataclasses import astuple, dataclass, field, replace
from types import MappingProxyType

from faao_mav.autopilot import AutopilotFamily, VehicleType
from faao_mav.autopilot.ardupilot import ARDUPILOT
from faao_mav.autopilot.px4 import PX4
from faao_mav.autopilot.vehicle_type import FenceAction
from faao_mav.wire.messages import Heartbeat


@dataclass(frozen=True, slots=True)
class Modes:
    """Custom modes of an autopilot that flies one type of vehicle.

    `rest` is one to stand on the ground in, `mission` flies the mission, `hold` stays at the place
    (a plane circles there) without sticks, `guided` flies by setpoints (None: streams are not flown
    by that type). `at_fence` are those that hold, return and land, as after a breach of the fence.
    In the modes `not_to_arm_in` the autopilot does not arm, or takes off as soon as it has.
    """

    rest: int
    mission: int
    hold: int
    at_fence: Mapping[FenceAction, int] = field(default_factory=dict)
    guided: int | None = None
    not_to_arm_in: frozenset[int] = frozenset()


def px4_mode(main: int, sub: int) -> int:
    """Return PX4's custom mode for a main and a sub mode; 0 for numbers that are none."""
    if not (0 <= main < 256 and 0 <= sub < 256):
        return 0
    return main << 16 | sub << 24


def mode_command(family: AutopilotFamily, mode: int) -> tuple[float, float, float]:
    """Return the first parameters of DO_SET_MODE for the custom `mode` of an autopilot.

    The first says that it is a custom mode. PX4 is told main and sub mode apart.

    >>> mode_command(PX4, px4_mode(4, 3)), mode_command(ARDUPILOT, 17)
    ((1.0, 4.0, 3.0), (1.0, 17.0, 0.0))
    """
    main, sub = (mode >> 16 & 255, mode >> 24) if family == PX4 else (mode, 0)
    return 1.0, float(main), float(sub)


_HOLD = px4_mode(4, 3)
_PX4 = Modes(
    rest=_HOLD,
    mission=px4_mode(4, 4),
    hold=_HOLD,
    at_fence=MappingProxyType({"hold": _HOLD, "return": px4_mode(4, 5), "land": px4_mode(4, 6)}),
    guided=px4_mode(6, 0),
    not_to_arm_in=frozenset(px4_mode(4, sub) for sub in (2, 5, 6, 9)),
)
_BRAKE, _LOITER = 17, 12
_COPTER = Modes(
    rest=0,
    mission=3,
    hold=_BRAKE,
    at_fence=MappingProxyType({"return": 6, "land": 9, "hold": _BRAKE}),
    guided=4,
    not_to_arm_in=frozenset({6, 7, 9, 14, 15, _BRAKE, 18, 21, 27}),
)
_MODES = {
    (ARDUPILOT, "copter"): _COPTER,
    (ARDUPILOT, "plane"): Modes(2, 10, _LOITER, {"return": 11}, not_to_arm_in=frozenset({11})),
    (PX4, "copter"): _PX4,
    (PX4, "plane"): replace(_PX4, guided=None),
}
"""COPTER_MODE and PLANE_MODE of MAVLink; PX4's main and sub modes in one number.

ArduCopter 4.7 does not arm in RTL, CIRCLE, LAND, FLIP, AUTOTUNE, BRAKE, SMART_RTL and AUTO_RTL (in
AUTO as AUTO_OPTIONS says), and takes off when thrown in THROW; ArduPlane not in RTL. PX4 1.16 does
not in Return, Land and Precision Land, and takes off in Takeoff.
"""


def modes_of(vehicle: VehicleType) -> Modes:
    """Return the modes of `vehicle`."""
    return _MODES[vehicle.family, vehicle.kind]


def mode_name(heartbeat: Heartbeat) -> str:
    """Return what people call the mode that `heartbeat` tells.

    >>> mode_name(Heartbeat(type=2, autopilot=3, base_mode=1, custom_mode=17, system_status=4))
    'BRAKE'
    """
    from pymavlink.dialects.v20.development import MAVLink_heartbeat_message
    from pymavlink.mavutil import mode_string_v10

    return str(mode_string_v10(MAVLink_heartbeat_message(*astuple(heartbeat))))
