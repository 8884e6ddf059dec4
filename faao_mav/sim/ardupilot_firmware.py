"""How ArduPilot takes and gives lists."""

from dataclasses import dataclass, replace
from types import MappingProxyType

from faao_mav.autopilot.ardupilot import ARDUPILOT
from faao_mav.autopilot.dialect import BESIDE
from faao_mav.errors import InputError
from faao_mav.mission.command import RALLY_POINT
from faao_mav.sim.firmware import MockFirmware
from faao_mav.wire.messages import (
    Envelope,
    GlobalPositionInt,
    ListMessage,
    Message,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
    MissionWritePartialList,
    Statustext,
    WireItem,
)
from faao_mav.wire.protocol import ALL_TYPES, Address, MavResult, MavSeverity, MissionType
from faao_mav.wire.wire_items import GLOBAL_FRAMES, mission_of

_RALLY_HIGHEST = 2**15
"""The altitude from which on a rally point is refused, m: what 16 bits hold."""


@dataclass(slots=True)
class _Receiving:
    """An upload under way; `fence` collects what takes effect only as a whole."""

    partner: Address
    next_sequence: int
    last_sequence: int
    last_item_time: float
    last_request_time: float
    fence: list[WireItem]


class ArduPilotFirmware(MockFirmware):
    """ArduPilot: each list has an upload of its own, and one partner at a time.

    A mission is changed item by item: an upload that stops half-way leaves new and old items mixed.
    """

    family = ARDUPILOT
    mission_limit = 655  # as in its simulator
    fence_texts = (Statustext(MavSeverity.NOTICE, "Polygon fence breached"),)
    armed_inside_only = True
    not_armed = 4
    not_armed_text = "Arm: {}"
    returns_by_mode = frozenset({"plane"})
    parameters = MappingProxyType({"SYSID_THISMAV": 1, "FRAME_CLASS": 1, "BATT_MONITOR": 4})
    misplaced = MavResult.UNSUPPORTED
    nonsense = MavResult.INVALID
    mode_denied, no_mode = 4, 2  # failed; denied

    def without_place(self, reports: list[Message]) -> list[Message]:
        """Return positions at 0, 0, as long as it does not know where it is."""
        told = [each for each in reports if isinstance(each, GlobalPositionInt)]
        return [replace(each, lat=0, lon=0, alt=0) for each in told]

    def check_beside(self, part: MissionType, item: WireItem) -> MavResult:
        """Return what it answers to `item` of a fence or of rally points that is on Earth."""
        if (item.command == RALLY_POINT) != (
            part is MissionType.RALLY
        ) or item.command not in BESIDE:
            return MavResult.UNSUPPORTED
        if item.frame not in GLOBAL_FRAMES:
            return MavResult.UNSUPPORTED_FRAME
        fits = part is MissionType.FENCE or abs(item.z) < _RALLY_HIGHEST
        return MavResult.ACCEPTED if fits else MavResult.INVALID_PARAM7

    @property
    def deadline(self) -> float | None:
        """When the next request or the end of patience is due."""
        return min(map(self._due, self._uploads.values()), default=None)

    def reset(self) -> None:
        """Forget what is under way, as a reboot does."""
        self._uploads: dict[MissionType, _Receiving] = {}

    def on(self, envelope: Envelope, now: float) -> list[Message]:
        """Answer a message of the mission protocol."""
        sender, message = envelope.sender, envelope.message
        if not isinstance(message, ListMessage):
            return []
        mission_type = message.mission_type
        if mission_type == ALL_TYPES and isinstance(message, MissionClearAll):
            return self._on_clear(sender, mission_type, tuple(MissionType))
        if mission_type not in tuple(MissionType):
            known = isinstance(message, MissionAck)
            return [] if known else [MissionAck(sender, mission_type, MavResult.UNSUPPORTED)]
        part = MissionType(mission_type)
        match message:
            case MissionCount(count=count):
                return self._on_count(sender, part, count, now)
            case MissionItemInt(seq=seq, item=item):
                return self._on_item(sender, part, seq, item, now)
            case MissionRequestList():
                return self._on_list(sender, part)
            case MissionRequestInt():
                return self._on_request(sender, part, message)
            case MissionClearAll():
                return self._on_clear(sender, mission_type, (part,))
            case MissionWritePartialList(start_index=first, end_index=last):
                return self._on_partial(sender, part, first, last, now)
        return []

    def tick(self, now: float) -> list[Message]:
        """Ask again, or give up."""
        out: list[Message] = []
        for part, upload in list(self._uploads.items()):
            if now >= upload.last_item_time + self._manners.patience:
                del self._uploads[part]
                out.append(Statustext(MavSeverity.WARNING, "Mission upload timeout"))
                out.append(MissionAck(upload.partner, part, MavResult.OPERATION_CANCELLED))
            elif now >= upload.last_request_time + self._manners.request_period:
                out.append(self._ask(part, upload, now))
        return out

    def _due(self, upload: _Receiving) -> float:
        return min(
            upload.last_item_time + self._manners.patience,
            upload.last_request_time + self._manners.request_period,
        )

    def _on_count(
        self, sender: Address, part: MissionType, count: int, now: float
    ) -> list[Message]:
        upload = self._uploads.get(part)
        if upload is not None and upload.partner != sender:
            return [MissionAck(sender, part, MavResult.DENIED)]
        result, limit = self.check_count(part, count), self.size_limit(part)
        if result != MavResult.ACCEPTED:
            text = Statustext(MavSeverity.WARNING, f"Only {limit} items are supported")
            return [MissionAck(sender, part, result), *([text] if count > limit else [])]
        if count == 0:
            self._lists.clear(part)
            self._uploads.pop(part, None)
            return [MissionAck(sender, part, MavResult.ACCEPTED)]
        if part is not MissionType.FENCE:
            self._lists.truncate(part, count)
        return self._begin(sender, part, 0, count - 1, now)

    def _on_partial(
        self, sender: Address, part: MissionType, first: int, last: int, now: float
    ) -> list[Message]:
        count = len(self._lists.items(part))
        if not 0 <= first <= last <= count:
            return [MissionAck(sender, part, MavResult.ERROR)]
        return self._begin(sender, part, first, last, now)

    def _begin(
        self, sender: Address, part: MissionType, first: int, last: int, now: float
    ) -> list[Message]:
        upload = _Receiving(sender, first, last, now, now, [])
        self._uploads[part] = upload
        return [self._ask(part, upload, now)]

    def _ask(self, part: MissionType, upload: _Receiving, now: float) -> Message:
        upload.last_request_time = now
        return MissionRequestInt(upload.partner, part, upload.next_sequence, self._legacy)

    def _on_item(
        self, sender: Address, part: MissionType, seq: int, item: WireItem, now: float
    ) -> list[Message]:
        upload = self._uploads.get(part)
        if upload is None:
            return [MissionAck(sender, part, MavResult.ERROR)]
        if seq != upload.next_sequence:
            return [MissionAck(sender, part, MavResult.INVALID_SEQUENCE)]
        if sender != upload.partner:
            return [MissionAck(sender, part, MavResult.DENIED)]
        result = self.check_item(part, seq, item)
        if result != MavResult.ACCEPTED:
            del self._uploads[part]
            return [MissionAck(sender, part, result)]
        if part is MissionType.FENCE:
            upload.fence.append(self._lists.kept(part, seq, item))
        else:
            self._lists.put(part, seq, item)
        upload.last_item_time, upload.next_sequence = now, seq + 1
        if seq < upload.last_sequence:
            return [self._ask(part, upload, now)]
        del self._uploads[part]
        if part is MissionType.FENCE:
            try:
                mission_of({part: upload.fence}, self._lists.vehicle)
            except InputError:
                text = Statustext(MavSeverity.WARNING, "Fence validation failed")
                return [text, MissionAck(sender, part, MavResult.ERROR)]
            self._lists.replace(part, upload.fence)
        return [MissionAck(sender, part, MavResult.ACCEPTED)]

    def _on_list(self, sender: Address, part: MissionType) -> list[Message]:
        if part in self._uploads:
            return [MissionAck(sender, part, MavResult.DENIED)]
        count = len(self._lists.items(part))
        return [MissionCount(sender, part, count)]

    def _on_request(
        self, sender: Address, part: MissionType, request: MissionRequestInt
    ) -> list[Message]:
        items = self._lists.items(part)
        if part in self._uploads and not request.legacy:
            return [MissionAck(sender, part, MavResult.DENIED)]
        if request.seq >= len(items):
            wrong = MavResult.ERROR if part is MissionType.MISSION else MavResult.INVALID_SEQUENCE
            return [MissionAck(sender, part, wrong)]
        return [MissionItemInt(sender, part, request.seq, items[request.seq], request.legacy)]

    def _on_clear(
        self, sender: Address, mission_type: int, parts: tuple[MissionType, ...]
    ) -> list[Message]:
        if MissionType.MISSION in parts and self._flying():
            return [MissionAck(sender, mission_type, MavResult.ERROR)]
        for part in parts:
            self._uploads.pop(part, None)
            self._lists.clear(part)
        return [MissionAck(sender, mission_type, MavResult.ACCEPTED)]
