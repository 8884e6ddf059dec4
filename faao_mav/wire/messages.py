# ruff: noqa: D101
"""The messages that missions and the mock autopilot are about, parsed whole.

Each type is named after its MAVLink message, and its fields have the message's names and units;
`faao_mav.wire.codec` turns packets into them and back. Coordinates stay the integers of the
wire, so that what was sent and what was found can be compared without rounding.
"""

from dataclasses import astuple, dataclass
from typing import TypeVar, dataclass_transform

from faao_mav.mission.item import Params
from faao_mav.wire.protocol import AIRFRAMES, ARMED, NO_AUTOPILOT, PREARM_CHECK, Address


@dataclass(frozen=True, slots=True)
class WireItem:
    """One item of a mission, fence or rally list as MISSION_ITEM_INT carries it.

    `x` and `y` are 1e-7 degrees in global frames, 1e-4 m in local ones and plain numbers in
    `Frame.MISSION`.
    """

    command: int
    frame: int
    params: Params
    x: int
    y: int
    z: float
    current: int = 0
    autocontinue: int = 1


@dataclass_transform(frozen_default=True)
@dataclass(frozen=True)
class Message:
    """What a packet says; each kind has a type of its own, which is a frozen dataclass."""

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True)(cls)


M = TypeVar("M", bound=Message)


class Addressed(Message):
    """A message for one system and component: `target_system` and `target_component`."""

    target: Address


class ListMessage(Addressed):
    """A message of the mission protocol: `mission_type` says which list it is about."""

    mission_type: int


class MissionCount(ListMessage):
    """MISSION_COUNT: so many items are to come, or are there."""

    count: int


class MissionRequestInt(ListMessage):
    seq: int


class MissionRequest(MissionRequestInt):
    """MISSION_REQUEST, the predecessor of MISSION_REQUEST_INT."""


class MissionItemInt(ListMessage):
    seq: int
    item: WireItem


class MissionAck(ListMessage):
    """MISSION_ACK; `type` is a MAV_MISSION_RESULT."""

    type: int


class MissionRequestList(ListMessage): ...


class MissionClearAll(ListMessage): ...


class MissionCurrent(Message):
    """MISSION_CURRENT; `total` leaves out ArduPilot's home item, 0 is for none.

    `mission_id` is the vehicle's number for the mission, 0 where it has none.
    """

    seq: int
    total: int
    mission_state: int
    mission_id: int = 0


class CurrentMode(Message):
    """CURRENT_MODE: the mode, and the one that was asked for last, another in a failsafe."""

    custom_mode: int
    intended_custom_mode: int


class CommandLong(Addressed):
    command: int
    confirmation: int
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    param5: float = 0.0
    param6: float = 0.0
    param7: float = 0.0


class CommandAck(Addressed):
    """COMMAND_ACK; `result` is a MAV_RESULT."""

    command: int
    result: int


class SetMode(Message):
    """SET_MODE, which is for all components of `target_system`."""

    target_system: int
    base_mode: int
    custom_mode: int


class ParamRequestList(Addressed): ...


class ParamRequestRead(Addressed):
    """PARAM_REQUEST_READ; `param_index` -1 asks by name."""

    param_id: str
    param_index: int


class ParamSet(Addressed):
    param_id: str
    param_value: float
    param_type: int


class ParamValue(Message):
    param_id: str
    param_value: float
    param_type: int
    param_count: int
    param_index: int


class Heartbeat(Message):
    type: int
    autopilot: int
    base_mode: int
    custom_mode: int
    system_status: int
    mavlink_version: int = 3

    @property
    def armed(self) -> bool:
        """Whether the motors may turn, if it is an autopilot's."""
        return bool(self.base_mode & ARMED)

    @property
    def mode_name(self) -> str:
        """What people call the mode.

        >>> Heartbeat(type=2, autopilot=3, base_mode=1, custom_mode=17, system_status=4).mode_name
        'BRAKE'
        """
        from pymavlink.dialects.v20.development import MAVLink_heartbeat_message
        from pymavlink.mavutil import mode_string_v10

        return str(mode_string_v10(MAVLink_heartbeat_message(*astuple(self))))

    @property
    def of_autopilot(self) -> bool:
        """Whether it is an aircraft's autopilot that says this, by its own account."""
        return self.type in AIRFRAMES and self.autopilot != NO_AUTOPILOT


class Timesync(Message):
    """TIMESYNC: a question (`tc1` 0) is answered with its own `ts1`, and `tc1` the time there."""

    tc1: int
    ts1: int


class Statustext(Message):
    """STATUSTEXT; `text` is one line."""

    severity: int
    text: str


class AutopilotVersion(Message):
    """AUTOPILOT_VERSION, as much as ground stations look at."""

    capabilities: int
    flight_sw_version: int
    uid: int


class GlobalPositionInt(Message):
    """GLOBAL_POSITION_INT: 1e-7 degrees, mm, cm/s north, east, down, heading in 0.01 degrees."""

    time_boot_ms: int
    lat: int
    lon: int
    alt: int
    relative_alt: int
    vx: int
    vy: int
    vz: int
    hdg: int


class Spot(Message):
    """A place on Earth: 1e-7 degrees, mm above mean sea level."""

    latitude: int
    longitude: int
    altitude: int


class GpsGlobalOrigin(Spot):
    """GPS_GLOBAL_ORIGIN: the origin of the vehicle's local frame."""


class SetPositionTargetLocalNed(Addressed):
    """SET_POSITION_TARGET_LOCAL_NED: m, m/s and m/s² north, east, down of the local origin.

    `type_mask` says which of them are to be ignored, yaw among them.
    """

    time_boot_ms: int
    coordinate_frame: int
    type_mask: int
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    afx: float
    afy: float
    afz: float


class LocalPositionNed(Message):
    """LOCAL_POSITION_NED: metres and m/s north, east, down of home."""

    time_boot_ms: int
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float


class Attitude(Message):
    """ATTITUDE: where it heads, radians from north; level and steady."""

    time_boot_ms: int
    yaw: float


class SysStatus(Message):
    """SYS_STATUS: millivolts (65535: unknown) and percent (-1: unknown) of the battery."""

    onboard_control_sensors_health: int
    voltage_battery: int
    battery_remaining: int

    @property
    def may_arm(self) -> bool:
        """Whether the autopilot's own checks before arming pass."""
        return bool(self.onboard_control_sensors_health & PREARM_CHECK)


class BatteryStatus(Message):
    """BATTERY_STATUS of one battery, percent (-1: unknown); `battery_function`: what it feeds."""

    id: int
    battery_function: int
    battery_remaining: int


class HomePosition(Spot):
    """HOME_POSITION: where the vehicle returns to."""


@dataclass(frozen=True, slots=True)
class Envelope:
    """A message, who sent it, and where it came from: the `Origin` of a transport."""

    sender: Address
    message: Message
    origin: str = ""

    def said(self, by: Address, kind: type[M]) -> M | None:
        """Return the message if it is of that `kind`, and `by` that sender; else None."""
        return self.message if self.sender == by and isinstance(self.message, kind) else None
