"""What only the wire shows of an autopilot: how it takes and gives lists of items.

Sources: `mavlink_mission.cpp` of PX4, `MissionItemProtocol.cpp` of ArduPilot (behaviour only), and
what both did in their simulators. Client and mock autopilot read the same table.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from faao_mav.autopilot import AutopilotFamily, VehicleType
from faao_mav.autopilot.ardupilot import ARDUPILOT
from faao_mav.autopilot.px4 import PX4
from faao_mav.wire.protocol import MavResult

_GENERAL = {
    MavResult.UNSUPPORTED_FRAME: "the frame of an item is not supported",
    MavResult.UNSUPPORTED: "a command, or this kind of list, is not supported",
    MavResult.INVALID: "an item, or this kind of list, is invalid",
    MavResult.INVALID_PARAM1: "param1 of an item is invalid",
    MavResult.INVALID_PARAM2: "param2 of an item is invalid",
    MavResult.INVALID_PARAM3: "param3 of an item is invalid",
    MavResult.INVALID_PARAM4: "param4 of an item is invalid",
    MavResult.INVALID_PARAM5_X: "the latitude (param5) of an item is out of range",
    MavResult.INVALID_PARAM6_Y: "the longitude (param6) of an item is out of range",
    MavResult.INVALID_PARAM7: "the altitude (param7) of an item is invalid",
    MavResult.INVALID_SEQUENCE: "an item came out of turn",
    MavResult.OPERATION_CANCELLED: "the vehicle gave the transfer up",
}


@dataclass(frozen=True, slots=True)
class Manners:
    """How an autopilot behaves in transfers; the defaults are those of one that is not known.

    `patience` is how long it waits for the next packet of a transfer before it gives up, s.

    In uploads: `request_period` is how long after its last request it asks again, s. An item that
    it did not ask for it passes over without a word (`ignores_other_items`), or answers
    INVALID_SEQUENCE and goes on waiting. `reminder` is the item, counted from the end (-1: the
    last one), to send again when the last acknowledgement is missing, None if none is safe.

    In downloads: `any_request_order` tells that it answers each request by itself, so that several
    can be under way, and `final_acks` how many acknowledgements it is sent at the end.

    `meanings` say what a result means if it is this autopilot's.
    """

    request_period: float = math.inf
    patience: float = math.inf
    ignores_other_items: bool = False
    reminder: int | None = None
    any_request_order: bool = False
    final_acks: int = 1
    meanings: Mapping[MavResult, str] = field(default_factory=dict)

    def meaning(self, result: int) -> str:
        """Return `result` by name, and what it says when this autopilot sends it.

        >>> Manners().meaning(13)
        'INVALID_SEQUENCE (an item came out of turn)'
        """
        try:
            known = MavResult(result)
        except ValueError:
            return f"result {result}"
        text = self.meanings.get(known) or _GENERAL.get(known)
        return f"{known.name} ({text})" if text else known.name


_UNKNOWN = Manners()
_MANNERS: dict[AutopilotFamily, Manners] = {
    ARDUPILOT: Manners(
        request_period=1.0,
        patience=8.0,
        reminder=-2,
        any_request_order=True,
        meanings={
            MavResult.ERROR: (
                "no transfer under way, an item beyond the list, or a change of the mission that "
                "it is flying"
            ),
            MavResult.INVALID: "command 0 or 1",
            MavResult.UNSUPPORTED: (
                "a command that this vehicle does not know, or fence and rally points over "
                "MAVLink 1"
            ),
            MavResult.DENIED: "another ground station is uploading",
        },
    ),
    PX4: Manners(
        request_period=0.25,
        patience=5.0,
        ignores_other_items=True,
        reminder=-1,
        final_acks=2,  # until it hears one, nobody else can begin a transfer for 5 s
        meanings={
            MavResult.ERROR: (
                "busy with another transfer, storage failed, a fence polygon of fewer than 3 "
                "vertices, or fence items in a mission"
            ),
            MavResult.INVALID: "this kind of list is unknown to it",
        },
    ),
}


def manners_of(vehicle: VehicleType | None) -> Manners:
    """Return the manners of `vehicle`; None, or one not listed here, follows the guide."""
    return _UNKNOWN if vehicle is None else _MANNERS.get(vehicle.family, _UNKNOWN)


def autopilot_name(vehicle: VehicleType | None) -> str:
    """Return what people call the autopilot of `vehicle`."""
    return "an autopilot unknown here" if vehicle is None else vehicle.family.name
