"""PX4 as a mock: how it takes and gives lists, and what else is its own."""

from faao_mav.autopilot.px4 import PX4, px4_mode
from faao_mav.mission.command import ABOVE_HOME, ABOVE_SEA, POLYGON, Command, Frame
from faao_mav.mission.item import Mission
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


def _said(text: str) -> Statustext:
    return Statustext(MavSeverity.CRITICAL, f"{text}\t")


class Px4Lists(ListServer):
    """One transfer at a time, and a new list replaces the old as a whole."""

    def reset(self) -> None:
        """Forget what is under way, as a reboot does."""
        super().reset()
        self._last = Transfer(NOBODY, MissionType.MISSION, 0, 0.0)
        """The transfer that there is, or the last that there was."""

    def on(self, envelope: Envelope, now: float) -> list[Message]:
        """Answer a message of the mission protocol."""
        sender, message = envelope.sender, envelope.message
        if not isinstance(message, ListMessage):
            return []
        known = message.mission_type in tuple(MissionType)
        partner = sender == self._last.partner
        match message:
            case MissionCount():
                return self._on_count(sender, message, now)
            case MissionItemInt():
                return self._on_item(message, now) if partner else [_refused("REJ. MIS ITEM")]
            case MissionAck():
                return self._on_ack(message, now) if partner else []
            case MissionRequestList() if known:
                return self._on_list(sender, MissionType(message.mission_type), now)
            case MissionRequestInt():
                return self._on_request(message, now) if partner else [_refused("WPM: REJ. CMD")]
            case MissionClearAll() if self._transfers:
                return [_said("WPM: IGN CLEAR CMD: Busy")]
            case MissionClearAll(mission_type=given) if known or given == ALL_TYPES:
                parts = MissionType if given == ALL_TYPES else (MissionType(given),)
                return self._cleared(sender, given, *parts)
        return []

    def _given_up(self, _: Transfer) -> list[Message]:
        return [_said("Operation timeout")]

    @property
    def _receiving(self) -> bool:
        return bool(self._transfers) and not self._last.sending

    @property
    def _sending(self) -> bool:
        return bool(self._transfers) and self._last.sending

    def _on_count(self, sender: Address, message: MissionCount, now: float) -> list[Message]:
        last = self._last
        if self._receiving:
            last.heard = now
            if sender == last.partner and last.passed == 0:
                return self._ask(last, now)
        if self._transfers:
            text = _said("WPM: IGN MISSION_COUNT: Busy")
            return [MissionAck(sender, last.part, MavResult.ERROR), text]
        if message.mission_type not in tuple(MissionType):
            return [MissionAck(sender, message.mission_type, MavResult.INVALID)]
        part = MissionType(message.mission_type)
        if (result := self._check_count(part, message.count)) != MavResult.ACCEPTED:
            return [MissionAck(sender, part, result)]
        if message.count == 0:
            return self._cleared(sender, part, part)
        self._last = Transfer(sender, part, message.count, now)
        return self._begin(self._last)

    def _on_item(self, message: MissionItemInt, now: float) -> list[Message]:
        last, seq = self._last, message.seq
        sender, part = last.partner, last.part
        self._legacy = message.legacy
        if message.mission_type != part or self._sending:
            return [MissionAck(sender, message.mission_type, MavResult.ERROR)]
        if not self._receiving:
            complete = last.passed == last.count or not self._behaviour.complete_only
            if seq + 1 == last.passed and complete:
                return self._accept()
            text = _said("IGN MISSION_ITEM: No transfer")
            return [MissionAck(sender, part, MavResult.ERROR), text]
        last.heard = now
        if seq != last.passed:
            return []
        result = self._check_item(part, seq, message.item)
        if result != MavResult.ACCEPTED:
            self._transfers.clear()
            return [MissionAck(sender, part, result), _said("IGN MISSION_ITEM: Invalid item")]
        last.items = (*last.items, self._stored.kept(part, seq, message.item))
        last.passed += 1
        if last.passed < last.count:
            return self._ask(last, now)
        self._transfers.clear()
        self._stored.replace(part, last.items)
        return self._accept()

    def _accept(self) -> list[Message]:
        part = self._last.part
        number = self._stored.number(part) if self._last.passed == self._last.count else 0
        return [MissionAck(self._last.partner, part, MavResult.ACCEPTED, number)]

    def _on_ack(self, ack: MissionAck, now: float) -> list[Message]:
        ends = self._sending and ack.mission_type == self._last.part
        if ends or (self._receiving and ack.type == MavResult.OPERATION_CANCELLED):
            self._transfers.clear()
        elif self._receiving and ack.type == MavResult.UNSUPPORTED:
            self._legacy = not self._legacy
            return self._ask(self._last, now)
        return []

    def _on_list(self, sender: Address, part: MissionType, now: float) -> list[Message]:
        last = self._last
        again = (sender, part) == (last.partner, last.part) or last.passed == last.count
        if self._transfers and not (last.sending and again):
            text = "Mission download request ignored, already active"
            return [Statustext(MavSeverity.INFO, text)]
        items = self._stored.items(part)
        self._last = Transfer(sender, part, len(items), now, sending=True, items=items)
        self._transfers = {part: self._last}
        return [MissionCount(sender, part, len(items), self._stored.number(part))]

    def _on_request(self, request: MissionRequestInt, now: float) -> list[Message]:
        last = self._last
        if not self._sending or request.mission_type != last.part:
            return []
        last.heard = now
        if request.seq == last.passed < last.count:
            last.passed += 1
        elif request.seq != last.passed - 1:
            self._transfers.clear()
            text = _said("WPM: REJ. CMD: Req. WP was unexpected")
            return [MissionAck(last.partner, last.part, MavResult.ERROR), text]
        item = last.items[request.seq]
        return [MissionItemInt(last.partner, last.part, request.seq, item, request.legacy)]


def _refused(what: str) -> Statustext:
    return _said(f"{what}: partner id mismatch")


def _beside(_: MissionType, item: WireItem) -> MavResult:
    if item.frame == Frame.MISSION:
        return MavResult.UNSUPPORTED
    if item.frame not in ABOVE_SEA | ABOVE_HOME:
        return MavResult.UNSUPPORTED_FRAME
    thin = item.command in POLYGON.values() and not item.params[0] >= 3
    return MavResult.ERROR if thin else MavResult.ACCEPTED


def _requested_mode(command: CommandLong) -> int | None:
    mode = px4_mode(whole(command.param2), whole(command.param3))
    return mode if is_custom(command) and mode else None


def _infeasible(mission: Mission) -> str:
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
    return "starts with landing" if positions[:1] == [Command.NAV_LAND] else ""


MOCK_PX4 = Behaviour(
    family=PX4,
    lists=Px4Lists,
    mission_limit=1000,
    misplaced=MavResult.ERROR,
    nonsense=MavResult.UNSUPPORTED,
    beside=_beside,
    requested_mode=_requested_mode,
    infeasible=_infeasible,
    silent_at_boot=True,
    numbers_missions=True,
    returns_by_mode=frozenset({"copter", "plane"}),
    fence_texts=(
        Statustext(MavSeverity.CRITICAL, "Geofence: approaching or outside geofence"),
        _said("Failsafe activated"),
    ),
    mode_denied=1,  # temporarily rejected
    no_mode=0,  # accepted, but nothing changes
    not_armed=1,
    not_armed_text="Arming denied: {}\t",
)
