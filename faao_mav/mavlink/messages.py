"""The messages that missions and the mock autopilot are about, parsed whole.

Each type is named after its MAVLink message, and its fields have the message's names and units;
`faao_mav.mavlink.codec` turns packets into them and back. Coordinates stay the integers of the
wire, so that what was sent and what was found can be compared without rounding.
"""

from dataclasses import dataclass
from typing import TypeAlias

from faao_mav.mavlink.transfer.protocol import ARMED, Address
from faao_mav.mission.item import Params


@dataclass(frozen=True, slots=True)
class Row:
    """What MISSION_ITEM_INT says about one item, apart from whom it is for.

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


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """HEARTBEAT."""

    type: int
    autopilot: int
    base_mode: int
    custom_mode: int
    system_status: int
    mavlink_version: int = 3

    @property
    def armed(self) -> bool:
        """Whether the motors may turn."""
        return bool(self.base_mode & ARMED)


@dataclass(frozen=True, slots=True)
class Statustext:
    """STATUSTEXT."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class MissionCount:
    """MISSION_COUNT: so many items are to come, or are there."""

    target_system: int
    target_component: int
    count: int
    mission_type: int
    opaque_id: int = 0


@dataclass(frozen=True, slots=True)
class MissionRequestInt:
    """MISSION_REQUEST_INT, or its predecessor MISSION_REQUEST (`legacy`)."""

    target_system: int
    target_component: int
    seq: int
    mission_type: int
    legacy: bool = False


@dataclass(frozen=True, slots=True)
class MissionItemInt:
    """MISSION_ITEM_INT, or its predecessor MISSION_ITEM (`legacy`), which has single precision."""

    target_system: int
    target_component: int
    seq: int
    mission_type: int
    row: Row
    legacy: bool = False


@dataclass(frozen=True, slots=True)
class MissionAck:
    """MISSION_ACK; `type` is a MAV_MISSION_RESULT."""

    target_system: int
    target_component: int
    type: int
    mission_type: int
    opaque_id: int = 0


@dataclass(frozen=True, slots=True)
class MissionRequestList:
    """MISSION_REQUEST_LIST."""

    target_system: int
    target_component: int
    mission_type: int


@dataclass(frozen=True, slots=True)
class MissionWritePartialList:
    """MISSION_WRITE_PARTIAL_LIST: items `start_index` to `end_index` are to be replaced."""

    target_system: int
    target_component: int
    start_index: int
    end_index: int
    mission_type: int


@dataclass(frozen=True, slots=True)
class MissionClearAll:
    """MISSION_CLEAR_ALL."""

    target_system: int
    target_component: int
    mission_type: int


@dataclass(frozen=True, slots=True)
class MissionSetCurrent:
    """MISSION_SET_CURRENT."""

    target_system: int
    target_component: int
    seq: int


@dataclass(frozen=True, slots=True)
class MissionCurrent:
    """MISSION_CURRENT; `total` leaves out ArduPilot's home row, 0 is for none."""

    seq: int
    total: int
    mission_state: int


@dataclass(frozen=True, slots=True)
class MissionItemReached:
    """MISSION_ITEM_REACHED."""

    seq: int


@dataclass(frozen=True, slots=True)
class CommandLong:
    """COMMAND_LONG."""

    target_system: int
    target_component: int
    command: int
    confirmation: int
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    param5: float = 0.0
    param6: float = 0.0
    param7: float = 0.0


@dataclass(frozen=True, slots=True)
class CommandAck:
    """COMMAND_ACK; `result` is a MAV_RESULT."""

    command: int
    result: int
    target_system: int
    target_component: int


@dataclass(frozen=True, slots=True)
class SetMode:
    """SET_MODE."""

    target_system: int
    base_mode: int
    custom_mode: int


@dataclass(frozen=True, slots=True)
class ParamRequestList:
    """PARAM_REQUEST_LIST."""

    target_system: int
    target_component: int


@dataclass(frozen=True, slots=True)
class ParamRequestRead:
    """PARAM_REQUEST_READ; `param_index` -1 asks by name."""

    target_system: int
    target_component: int
    param_id: str
    param_index: int


@dataclass(frozen=True, slots=True)
class ParamSet:
    """PARAM_SET."""

    target_system: int
    target_component: int
    param_id: str
    param_value: float
    param_type: int


@dataclass(frozen=True, slots=True)
class ParamValue:
    """PARAM_VALUE."""

    param_id: str
    param_value: float
    param_type: int
    param_count: int
    param_index: int


@dataclass(frozen=True, slots=True)
class AutopilotVersion:
    """AUTOPILOT_VERSION, as much as ground stations look at."""

    capabilities: int
    flight_sw_version: int
    uid: int


@dataclass(frozen=True, slots=True)
class GlobalPositionInt:
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


@dataclass(frozen=True, slots=True)
class LocalPositionNed:
    """LOCAL_POSITION_NED: metres and m/s north, east, down of home."""

    time_boot_ms: int
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float


@dataclass(frozen=True, slots=True)
class Attitude:
    """ATTITUDE: radians and rad/s."""

    time_boot_ms: int
    roll: float
    pitch: float
    yaw: float
    rollspeed: float
    pitchspeed: float
    yawspeed: float


@dataclass(frozen=True, slots=True)
class HomePosition:
    """HOME_POSITION: 1e-7 degrees, mm above mean sea level."""

    latitude: int
    longitude: int
    altitude: int


Transfer: TypeAlias = (
    MissionCount
    | MissionRequestInt
    | MissionItemInt
    | MissionAck
    | MissionRequestList
    | MissionClearAll
    | MissionWritePartialList
)
"""What belongs to a transfer: it is addressed, and says which list it is about."""

Message: TypeAlias = (
    Transfer
    | Heartbeat
    | Statustext
    | MissionSetCurrent
    | MissionCurrent
    | MissionItemReached
    | CommandLong
    | CommandAck
    | SetMode
    | ParamRequestList
    | ParamRequestRead
    | ParamSet
    | ParamValue
    | AutopilotVersion
    | GlobalPositionInt
    | LocalPositionNed
    | Attitude
    | HomePosition
)


@dataclass(frozen=True, slots=True)
class Envelope:
    """A message and who sent it."""

    sender: Address
    message: Message
