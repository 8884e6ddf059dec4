"""ArduPilot as a mock: how it takes and gives lists, and what else is its own."""

from faao_mav.autopilot.ardupilot import ARDUPILOT
from faao_mav.autopilot.dialect import BESIDE
from faao_mav.errors import InputError
from faao_mav.mission.command import RALLY_POINT
from faao_mav.sim.firmware import Behaviour, ListServer, Transfer, is_custom, whole
from faao_mav.wire.messages import (
    CommandLong,
    Envelope,
    ListMessage,
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
from faao_mav.wire.protocol import ALL_TYPES, Address, MavResult, MavSeverity, MissionType
from faao_mav.wire.wire_items import GLOBAL_FRAMES, mission_of

_RALLY_HIGHEST = 2**15
"""The altitude from which on a rally point is refused, m: what 16 bits hold."""


class ArduPilotLists(ListServer):
    """Each list has an upload of its own, and one partner at a time.

    A mission is changed item by item: an upload that stops half-way leaves new and old items mixed.
    A fence takes effect as a whole.
    """

    def on(self, envelope: Envelope, now: float) -> list[Message]:
        """Answer a message of the mission protocol."""
        sender, message = envelope.sender, envelope.message
        if not isinstance(message, ListMessage) or isinstance(message, MissionAck):
            return []
        mission_type, cleared = message.mission_type, isinstance(message, MissionClearAll)
        if mission_type == ALL_TYPES and cleared:
            return self._on_clear(sender, mission_type, *MissionType)
        if mission_type not in tuple(MissionType):
            return [MissionAck(sender, mission_type, MavResult.UNSUPPORTED)]
        part = MissionType(mission_type)
        if cleared:
            return self._on_clear(sender, part, part)
        upload = self._transfers.get(part)
        match message:
            case MissionCount(count=count):
                return self._on_count(sender, part, count, now)
            case MissionItemInt(seq=seq, item=item):
                if upload is None:
                    return [MissionAck(sender, part, MavResult.ERROR)]
                if seq != upload.passed:
                    return [MissionAck(sender, part, MavResult.INVALID_SEQUENCE)]
                if sender == upload.partner:
                    return self._take(upload, item, now)
            case MissionRequestList() if upload is None:
                return [MissionCount(sender, part, len(self._stored.items(part)))]
            case MissionRequestInt(legacy=legacy) if upload is None or legacy:
                return self._give(sender, part, message)
        return [MissionAck(sender, part, MavResult.DENIED)]

    def _on_count(
        self, sender: Address, part: MissionType, count: int, now: float
    ) -> list[Message]:
        upload = self._transfers.get(part)
        if upload is not None and upload.partner != sender:
            return [MissionAck(sender, part, MavResult.DENIED)]
        result, limit = self._check_count(part, count), self._size_limit(part)
        if result != MavResult.ACCEPTED:
            text = Statustext(MavSeverity.WARNING, f"Only {limit} items are supported")
            return [MissionAck(sender, part, result), *([text] if count > limit else [])]
        if count == 0:
            return self._cleared(sender, part, part)
        if part is not MissionType.FENCE:
            self._stored.replace(part, self._stored.items(part)[:count])
        return self._begin(Transfer(sender, part, count, now))

    def _take(self, upload: Transfer, item: WireItem, now: float) -> list[Message]:
        sender, part, seq = upload.partner, upload.part, upload.passed
        result = self._check_item(part, seq, item)
        if result != MavResult.ACCEPTED:
            del self._transfers[part]
            return [MissionAck(sender, part, result)]
        upload.items = (*upload.items, self._stored.kept(part, seq, item))
        upload.heard, upload.passed = now, seq + 1
        if part is not MissionType.FENCE:
            old = self._stored.items(part)[seq + 1 :]
            self._stored.replace(part, (*upload.items, *old))
        if upload.passed < upload.count:
            return self._ask(upload, now)
        del self._transfers[part]
        if part is MissionType.FENCE:
            try:
                mission_of({part: upload.items}, self._stored.vehicle)
            except InputError:
                text = Statustext(MavSeverity.WARNING, "Fence validation failed")
                return [text, MissionAck(sender, part, MavResult.ERROR)]
            self._stored.replace(part, upload.items)
        return [MissionAck(sender, part, MavResult.ACCEPTED)]

    def _give(
        self, sender: Address, part: MissionType, request: MissionRequestInt
    ) -> list[Message]:
        items = self._stored.items(part)
        if request.seq < len(items):
            item = items[request.seq]
            return [MissionItemInt(sender, part, request.seq, item, request.legacy)]
        wrong = MavResult.ERROR if part is MissionType.MISSION else MavResult.INVALID_SEQUENCE
        return [MissionAck(sender, part, wrong)]

    def _on_clear(self, sender: Address, mission_type: int, *parts: MissionType) -> list[Message]:
        if MissionType.MISSION in parts and self._flying():
            return [MissionAck(sender, mission_type, MavResult.ERROR)]
        return self._cleared(sender, mission_type, *parts)

    def _given_up(self, transfer: Transfer) -> list[Message]:
        text = Statustext(MavSeverity.WARNING, "Mission upload timeout")
        ack = MissionAck(transfer.partner, transfer.part, MavResult.OPERATION_CANCELLED)
        return [text, ack]


def _beside(part: MissionType, item: WireItem) -> MavResult:
    if (item.command == RALLY_POINT) != (part is MissionType.RALLY) or item.command not in BESIDE:
        return MavResult.UNSUPPORTED
    if item.frame not in GLOBAL_FRAMES:
        return MavResult.UNSUPPORTED_FRAME
    fits = part is MissionType.FENCE or abs(item.z) < _RALLY_HIGHEST
    return MavResult.ACCEPTED if fits else MavResult.INVALID_PARAM7


def _requested_mode(command: CommandLong) -> int | None:
    number = whole(command.param2)
    return number if is_custom(command) and number >= 0 else None


MOCK_ARDUPILOT = Behaviour(
    family=ARDUPILOT,
    lists=ArduPilotLists,
    legacy_first=True,
    mission_limit=655,  # as in its simulator
    misplaced=MavResult.UNSUPPORTED,
    nonsense=MavResult.INVALID,
    beside=_beside,
    requested_mode=_requested_mode,
    parameters={"SYSID_THISMAV": 1, "FRAME_CLASS": 1, "BATT_MONITOR": 4},
    tells_no_place=True,
    returns_by_mode=frozenset({"plane"}),
    fence_texts=(Statustext(MavSeverity.NOTICE, "Polygon fence breached"),),
    armed_inside_only=True,
    mode_denied=4,  # failed
    no_mode=2,  # denied
    not_armed=4,
    not_armed_text="Arm: {}",
)
