"""How PX4 takes and gives lists."""

from dataclasses import dataclass
from typing import Literal

from faao_mav.autopilot.px4 import PX4, px4_mode
from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, POLYGON, Command, Frame
from faao_mav.mission.item import Mission
from faao_mav.sim.firmware import MockFirmware, is_custom, whole
from faao_mav.wire.messages import (
    CommandLong,
    Envelope,
    Message,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
    Statustext,
    WireItem,
)
from faao_mav.wire.protocol import (
    ALL_TYPES,
    NOBODY,
    Address,
    MavResult,
    MavSeverity,
    MissionType,
)

_POSITIONS = frozenset({16, 17, 18, 19, 21, 22, 31, 82, 84, 85})
"""Commands that PX4 counts as positions."""


@dataclass(slots=True)
class _Transfer:
    """The one transfer that there is, or the last that there was (state "idle")."""

    state: Literal["idle", "receiving", "sending"] = "idle"
    partner: Address = NOBODY
    part: MissionType = MissionType.MISSION
    next_sequence: int = 0
    count: int = 0
    number: int = 0
    last_message_time: float = 0.0
    last_request_time: float = 0.0
    items: tuple[WireItem, ...] = ()


def _said(text: str) -> Statustext:
    return Statustext(MavSeverity.CRITICAL, f"{text}\t")


class Px4Firmware(MockFirmware):
    """PX4: one transfer at a time, and a new list replaces the old as a whole."""

    family = PX4
    mission_limit = 1000
    numbers_missions = True
    returns_by_mode = frozenset({"copter", "plane"})
    fence_texts = (
        Statustext(MavSeverity.CRITICAL, "Geofence: approaching or outside geofence"),
        _said("Failsafe activated"),
    )
    misplaced = MavResult.ERROR
    nonsense = MavResult.UNSUPPORTED
    silent_at_boot = True
    mode_denied, no_mode = 1, 0  # temporarily rejected; accepted, but nothing changes
    not_armed = 1
    not_armed_text = "Arming denied: {}\t"

    def requested_mode(self, command: CommandLong) -> int | None:
        """Return the custom mode that DO_SET_MODE asks for: main and sub mode are two numbers."""
        mode = px4_mode(whole(command.param2), whole(command.param3))
        return mode if is_custom(command) and mode else None

    def infeasible(self, mission: Mission) -> str | None:
        """Return why PX4, which says so in an event only, refuses to start `mission`."""
        commands = [item.command for item in mission.items]
        positions = [command for command in commands if command in _POSITIONS]
        takeoffs = [item for item in mission.items if item.command == Command.NAV_TAKEOFF]
        if Command.CONDITION_DELAY in commands:
            return "unsupported command"
        if any(item.z <= 0 for item in takeoffs):
            return "take-off altitude too low"
        if len(takeoffs) > 1 or (takeoffs and positions[0] != Command.NAV_TAKEOFF):
            return "take-off is not the first position"
        return "starts with landing" if positions[:1] == [Command.NAV_LAND] else None

    def check_beside(self, part: MissionType, item: WireItem) -> MavResult:  # noqa: ARG002
        """Return what it answers to `item` of a fence or of rally points that is on Earth."""
        if item.frame == Frame.MISSION:
            return MavResult.UNSUPPORTED
        if item.frame not in ABOVE_SEA | ABOVE_HOME:
            return MavResult.UNSUPPORTED_FRAME
        thin = item.command in POLYGON.values() and not item.params[0] >= 3
        return MavResult.ERROR if thin else MavResult.ACCEPTED

    @property
    def deadline(self) -> float | None:
        """When the next request or the end of patience is due."""
        transfer = self._transfer
        if transfer.state == "idle":
            return None
        end = transfer.last_message_time + self._manners.patience
        if transfer.state == "receiving":
            return min(end, transfer.last_request_time + self._manners.request_period)
        return end

    def reset(self) -> None:
        """Forget what is under way, as a reboot does."""
        self._transfer = _Transfer()

    def on(self, envelope: Envelope, now: float) -> list[Message]:
        """Answer a message of the mission protocol."""
        sender = envelope.sender
        match envelope.message:
            case MissionCount(count=count, mission_type=mission_type):
                return self._on_count(sender, mission_type, count, now)
            case MissionItemInt() as item:
                return self._on_item(sender, item, now)
            case MissionAck() as ack:
                return self._on_ack(sender, ack, now)
            case MissionRequestList(mission_type=mission_type):
                return self._on_list(sender, mission_type, now)
            case MissionRequestInt() as request:
                return self._on_request(sender, request, now)
            case MissionClearAll(mission_type=mission_type):
                return self._on_clear(sender, mission_type)
        return []

    def tick(self, now: float) -> list[Message]:
        """Ask again, or give up in silence."""
        transfer = self._transfer
        if transfer.state == "idle":
            return []
        if now >= transfer.last_message_time + self._manners.patience:
            transfer.state = "idle"
            return [_said("Operation timeout")]
        request_due = transfer.last_request_time + self._manners.request_period
        return [self._ask(now)] if transfer.state == "receiving" and now >= request_due else []

    def _on_count(
        self, sender: Address, mission_type: int, count: int, now: float
    ) -> list[Message]:
        transfer = self._transfer
        if transfer.state == "receiving":
            transfer.last_message_time = now
            if sender == transfer.partner and transfer.next_sequence == 0:
                return [self._ask(now)]
        if transfer.state != "idle":
            return [
                MissionAck(sender, transfer.part, MavResult.ERROR),
                _said("WPM: IGN MISSION_COUNT: Busy"),
            ]
        if mission_type not in tuple(MissionType):
            return [MissionAck(sender, mission_type, MavResult.INVALID)]
        part = MissionType(mission_type)
        if (result := self.check_count(part, count)) != MavResult.ACCEPTED:
            return [MissionAck(sender, part, result)]
        if count == 0:
            self._lists.clear(part)
            return [MissionAck(sender, part, MavResult.ACCEPTED)]
        self._transfer = _Transfer("receiving", sender, part, 0, count, 0, now)
        return [self._ask(now)]

    def _ask(self, now: float) -> Message:
        transfer = self._transfer
        transfer.last_request_time = now
        return MissionRequestInt(
            transfer.partner, transfer.part, transfer.next_sequence, self._legacy
        )

    def _on_item(self, sender: Address, item: MissionItemInt, now: float) -> list[Message]:
        transfer = self._transfer
        if sender != transfer.partner:
            return [_said("REJ. MIS ITEM: partner id mismatch")]
        self._legacy = item.legacy
        if item.mission_type != transfer.part or transfer.state == "sending":
            return [MissionAck(sender, item.mission_type, MavResult.ERROR)]
        if transfer.state == "idle":
            return self._on_late_item(sender, item)
        transfer.last_message_time = now
        if item.seq != transfer.next_sequence:
            return []
        return self._take(item, now)

    def _on_late_item(self, sender: Address, item: MissionItemInt) -> list[Message]:
        transfer = self._transfer
        complete = transfer.next_sequence == transfer.count or not self._behaviour.complete_only
        if item.seq + 1 == transfer.next_sequence and complete:
            return [MissionAck(sender, transfer.part, MavResult.ACCEPTED, transfer.number)]
        text = _said("IGN MISSION_ITEM: No transfer")
        return [MissionAck(sender, transfer.part, MavResult.ERROR), text]

    def _take(self, item: MissionItemInt, now: float) -> list[Message]:
        transfer, part = self._transfer, self._transfer.part
        result = self.check_item(part, item.seq, item.item)
        if result != MavResult.ACCEPTED:
            transfer.state = "idle"
            text = _said("IGN MISSION_ITEM: Invalid item")
            return [MissionAck(transfer.partner, part, result), text]
        transfer.items = (*transfer.items, self._lists.kept(part, item.seq, item.item))
        transfer.next_sequence += 1
        if transfer.next_sequence < transfer.count:
            return [self._ask(now)]
        transfer.state = "idle"
        self._lists.replace(part, transfer.items)
        transfer.number = self._lists.number(part)
        return [MissionAck(transfer.partner, part, MavResult.ACCEPTED, transfer.number)]

    def _on_ack(self, sender: Address, ack: MissionAck, now: float) -> list[Message]:
        transfer = self._transfer
        if sender != transfer.partner:
            return []
        if transfer.state == "sending" and ack.mission_type == transfer.part:
            transfer.state = "idle"
        elif transfer.state == "receiving":
            if ack.type == MavResult.UNSUPPORTED:
                self._legacy = not self._legacy
                return [self._ask(now)]
            if ack.type == MavResult.OPERATION_CANCELLED:
                transfer.state = "idle"
        return []

    def _on_list(self, sender: Address, mission_type: int, now: float) -> list[Message]:
        transfer = self._transfer
        again = sender == transfer.partner and mission_type == transfer.part
        done = transfer.next_sequence == transfer.count
        free = transfer.state == "idle" or (transfer.state == "sending" and (again or done))
        if not free or mission_type not in tuple(MissionType):
            return [
                Statustext(MavSeverity.INFO, "Mission download request ignored, already active")
            ]
        part = MissionType(mission_type)
        items = self._lists.items(part)
        self._transfer = _Transfer("sending", sender, part, 0, len(items), 0, now, items=items)
        number = self._lists.number(part)
        return [MissionCount(sender, part, len(items), number)]

    def _on_request(self, sender: Address, request: MissionRequestInt, now: float) -> list[Message]:
        transfer = self._transfer
        if sender != transfer.partner:
            return [_said("WPM: REJ. CMD: partner id mismatch")]
        if transfer.state != "sending" or request.mission_type != transfer.part:
            return []
        transfer.last_message_time = now
        if request.seq == transfer.next_sequence < transfer.count:
            transfer.next_sequence += 1
        elif request.seq != transfer.next_sequence - 1:
            transfer.state = "idle"
            text = _said("WPM: REJ. CMD: Req. WP was unexpected")
            return [MissionAck(sender, transfer.part, MavResult.ERROR), text]
        item = transfer.items[request.seq]
        return [MissionItemInt(sender, transfer.part, request.seq, item, request.legacy)]

    def _on_clear(self, sender: Address, mission_type: int) -> list[Message]:
        if self._transfer.state != "idle":
            return [_said("WPM: IGN CLEAR CMD: Busy")]
        if mission_type != ALL_TYPES and mission_type not in tuple(MissionType):
            return []
        for part in MissionType:
            if mission_type in (part, ALL_TYPES):
                self._lists.clear(part)
        return [MissionAck(sender, mission_type, MavResult.ACCEPTED)]
