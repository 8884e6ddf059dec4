"""The transfers of one list, as talks: uploading, clearing and downloading it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

from faao_mav.autopilot import VehicleType
from faao_mav.autopilot.manners import Manners
from faao_mav.wire import messages
from faao_mav.wire.machine import AT_ONCE, SILENCE, SLOWEST, Pace, Questions, Script, Talk
from faao_mav.wire.messages import Envelope, ListMessage, MissionAck, WireItem
from faao_mav.wire.protocol import Address, MavResult, MissionType
from faao_mav.wire.wire_items import Difference

Verdict: TypeAlias = Literal[
    "accepted", "unknown", "verified", "different", "unread", "refused", "silent", "armed",
    "cancelled",
]  # fmt: skip

ATTEMPTS = 3
"""How often a transfer is begun that gets no further; chosen."""

TENTATIVE = frozenset({MavResult.ERROR, MavResult.DENIED})
"""Results that PX4 and ArduPilot also give to late packets of an earlier transfer: they count when
nothing else is said."""

_OF_UPLOADS = TENTATIVE | {MavResult.INVALID_SEQUENCE, MavResult.OPERATION_CANCELLED}
"""Results that may be about an upload while a list is read: a late item of it, or a late copy of
its announcement, for whose items ArduPilot waits 8 s until it says that it has given up."""

_OPENING = -1  # The question that opens a transfer, where the others are the numbers of items.

_TEXTS = 5  # The number of status texts that are kept, the last ones. Chosen.
_REASONS = 1.5  # Seconds to wait after a refusal for the text that gives the reason. Chosen.

_LATE = 0.4
"""By how many seconds packets are taken to be late, once one has ended a transfer: chosen, above
the 0.3 s of the links in the tests; it doubles as long as that is not enough."""

_WINDOW = 5
"""Items asked for at once where the autopilot answers each request by itself: MAVProxy's number."""


@dataclass(slots=True, eq=False)
class Peer:
    """Both ends of a transfer, and what flies at the other: None if its autopilot is not known.

    Unless it `may_be_armed`, nothing more is written once a heartbeat of it says that it is armed.
    `pace` is what its transfers have learnt so far of how long answers take, `late` for how many
    seconds after its answer a request of a download may still be on its way, `beat` the vehicle's
    last heartbeat.
    """

    own: Address
    address: Address
    vehicle: VehicleType | None
    may_be_armed: bool = False
    pace: Pace = field(default_factory=Pace)
    late: float = 0.0
    beat: messages.Heartbeat | None = None

    @property
    def manners(self) -> Manners:
        """How the other end behaves in transfers."""
        return Manners() if self.vehicle is None else self.vehicle.family.manners


@dataclass(frozen=True, slots=True)
class PartReport:
    """What became of one list.

    `verdict`: "refused" with the `result`; "silent": it got no further; "armed": stopped because
    the vehicle is armed; "cancelled" by the vehicle. Of a transfer, "accepted"; "unknown":
    everything was sent, but the last answer is missing or ambiguous. Of an upload that is read
    back, "verified": it is what was sent but for what `differences` tell as dropped; "different":
    it is not; "unread": accepted, but could not be read back.

    `item` is the number of the item last asked for, `found` what was downloaded, `said` the
    vehicle's own words. `items` are those sent, without the home item; `attempts` counts uploads.
    """

    part: MissionType
    verdict: Verdict
    result: int | None = None
    item: int | None = None
    found: tuple[WireItem, ...] = ()
    said: tuple[str, ...] = ()
    items: int = 0
    attempts: int = 1
    differences: tuple[Difference, ...] = ()

    @property
    def verified(self) -> bool:
        """Whether the list is on the vehicle, whole and equal."""
        return self.verdict == "verified"


class _Exchange(Questions[int]):
    """One list on its way: its questions, and what the vehicle says.

    `item` is the number of the item last asked for; `doubted` what the vehicle said last, if that
    was a no that may be about something else.
    """

    def __init__(self, line: Script[Any], peer: Peer, part: MissionType, *, writes: bool) -> None:
        super().__init__(line, peer.pace, SILENCE)
        self._peer, self._part = peer, part
        self._writes = writes and not peer.may_be_armed
        self._texts: list[str] = []
        self.item: int | None = None
        self.doubted: int | None = None

    @property
    def over(self) -> bool:
        """Whether nothing more is waited for, or to be written as the vehicle is armed."""
        return super().over or self.armed

    @property
    def armed(self) -> bool:
        """Whether nothing more is to be written because the vehicle is armed."""
        return self._writes and self._peer.beat is not None and self._peer.beat.armed

    def further(self) -> None:
        """Note that it has got further."""
        super().further()
        self.doubted = None

    def doubt(self, result: int) -> None:
        """Note a refusal that counts if nothing else is said soon; a busy vehicle is asked on."""
        self.doubted = result
        if _OPENING not in self.asked:
            self.asked.clear()
            self.until = min(self.until, self._line.now + SLOWEST)

    def said(self) -> Talk[ListMessage | None]:
        """Return what the vehicle says of the list; None: it is over."""
        while not self.over:
            heard = yield from self.hear()
            told = heard and heard.said(self._peer.address, ListMessage)
            if told and told.mission_type == self._part and self._peer.own.takes(told.target):
                return told
        return None

    def listen(self, seconds: float) -> Talk[None]:
        """Pass over what is said for some time."""
        self.until = self._line.now + seconds
        while not self.over:
            yield from self.hear()

    def hear(self) -> Talk[Envelope | None]:
        """Return what is heard next, heartbeats and status texts of the vehicle noted."""
        try:
            heard = yield from super().hear()
        except GeneratorExit:
            self.cancel()
            raise
        if heard is not None:
            vehicle = self._peer.address
            self._peer.beat = heard.said(vehicle, messages.Heartbeat) or self._peer.beat
            if text := heard.said(vehicle, messages.Statustext):
                self._texts = [*self._texts[1 - _TEXTS :], text.text.strip()]
        return heard

    def cancel(self) -> None:
        """Tell the vehicle that this transfer is over."""
        self._line.say(MissionAck(self._peer.address, self._part, MavResult.OPERATION_CANCELLED))

    def stop(self, result: int | None = None) -> PartReport:
        """End it where nothing more is said, or it was refused with `result`; tell the vehicle."""
        self.cancel()
        if self.armed:
            return self.end("armed")
        result = result or self.doubted
        return self.end("silent" if result is None else "refused", result)

    def end(
        self, verdict: Verdict, result: int | None = None, found: tuple[WireItem, ...] = ()
    ) -> PartReport:
        """Return how it ended."""
        said = tuple(dict.fromkeys(self._texts))
        return PartReport(self._part, verdict, result, self.item, found, said)


def send_list(
    items: Sequence[WireItem],
    peer: Peer,
    part: MissionType = MissionType.MISSION,
    *,
    in_pairs: bool = True,
) -> Talk[PartReport]:
    """Upload `items`, or clear the list where there are none; the vehicle leads.

    - Any item below the count is sent whenever it is asked for, by either request, as
      MISSION_ITEM_INT. PX4 and ArduPilot are sent it again when nothing follows: it was lost, or
      the request for the next one was.
    - PX4 takes the item that it waits for and passes over any other, so it is sent the next one
      too, whichever was lost, but never the last one unasked. If it refuses one of the two, it is
      not known which: the upload begins anew, not `in_pairs`.
    - ArduPilot says INVALID_SEQUENCE of an item that it has, and is sent the next one.
    - An ERROR may be about a duplicate too (PX4: of MISSION_COUNT), and DENIED about a late request
      of a download before: they count when nothing more is asked for.
    - When everything was sent and no answer comes, the verdict is "unknown", and reading back must
      tell.
    """
    line = yield AT_ONCE
    exchange, last = _Exchange(line, peer, part, writes=True), len(items) - 1
    what = f"{'uploading' if items else 'clearing'} {part.title}"
    pairs = in_pairs and peer.manners.ignores_other_items

    def send(seq: int) -> None:
        numbers = (seq + 1, seq) if pairs and seq + 1 < last else (seq,)
        again = [messages.MissionItemInt(peer.address, part, each, items[each]) for each in numbers]
        exchange.put(seq, again[-1], again=tuple(again))
        if peer.vehicle is None:
            exchange.asked.clear()

    current = furthest = _OPENING
    if not exchange.over:
        count = messages.MissionCount(peer.address, part, len(items))
        exchange.put(_OPENING, count if items else messages.MissionClearAll(peer.address, part))
    while True:
        line.progress = what, furthest + 1, len(items)
        exchange.item = None if current == _OPENING else current
        match (yield from exchange.said()):
            case None if furthest == last and not exchange.armed:
                return exchange.end("unknown", exchange.doubted)
            case None:
                return exchange.stop()
            case messages.MissionRequestInt(seq=seq) if seq <= last:
                if seq > current:
                    exchange.answer(current)
                elif seq < current:
                    exchange.asked.clear()
                if seq > furthest:
                    exchange.further()
                current, furthest, exchange.doubted = seq, max(furthest, seq), None
                send(seq)
            case MissionAck(type=MavResult.ACCEPTED):
                # Before the last item was asked for it can only be about something else.
                if furthest == last:
                    return exchange.end("accepted", MavResult.ACCEPTED)
            case MissionAck(type=MavResult.INVALID_SEQUENCE):
                if exchange.times(current) > 1 and current + 1 < last:
                    exchange.answer(current)
                    current += 1
                    send(current)
            case MissionAck() if pairs and exchange.times(current) > 1 and current != _OPENING:
                exchange.cancel()
                return (yield from send_list(items, peer, part, in_pairs=False))
            case MissionAck(type=result) if result in TENTATIVE:
                exchange.doubt(result)
            case MissionAck(type=MavResult.OPERATION_CANCELLED as result):
                return exchange.end("cancelled", result)
            case MissionAck(type=result):
                exchange.asked.clear()
                yield from exchange.listen(_REASONS)
                return exchange.stop(result)


def read_list(peer: Peer, part: MissionType = MissionType.MISSION) -> Talk[PartReport]:
    """Download a list and acknowledge it.

    PX4 gives the item that it expects to be asked for, or the one before, and ends the transfer
    with ERROR at any other request (`handle_mission_request_both`): it is asked for one item at a
    time, and so are autopilots that are not known. ArduPilot answers each request by itself
    (`handle_mission_request_int`): like MAVProxy, this asks it for up to five items at once, once
    it is known how long answers take.

    When it gets no further it begins anew, `ATTEMPTS` times. As a request that came late
    may have ended it, each item is then waited for some time longer.
    """
    line = yield AT_ONCE
    exchange, wide = _Exchange(line, peer, part, writes=False), peer.manners.any_request_order
    for _ in range(ATTEMPTS):
        items, count, following = dict[int, WireItem](), -1, 0
        exchange.asked.clear()
        exchange.further()
        exchange.put(_OPENING, messages.MissionRequestList(peer.address, part))
        while len(items) != count:
            line.progress = f"reading {part.title}", len(items), max(count, 0)
            match (yield from exchange.said()):
                case None:
                    break
                case messages.MissionCount() as told if exchange.answer(_OPENING):
                    count = told.count
                case messages.MissionItemInt(seq=seq, item=item) if exchange.answer(seq):
                    items[seq] = item
                case MissionAck(type=result) if result in _OF_UPLOADS:
                    exchange.doubt(result)
                    continue
                case MissionAck(type=result) if result != MavResult.ACCEPTED:
                    return exchange.end("refused", result)
                case _:
                    continue
            yield from exchange.listen(peer.late)
            exchange.further()
            room = _WINDOW if wide and exchange.pace.mean is not None else 1
            while following < count and len(exchange.asked) < room:
                request = messages.MissionRequestInt(peer.address, part, following)
                exchange.put(following, request)
                following += 1
        else:
            ack = MissionAck(peer.address, part, MavResult.ACCEPTED)
            line.say(*[ack] * peer.manners.final_acks)
            return exchange.end("accepted", None, tuple(items[seq] for seq in range(count)))
        peer.late = 0.0 if wide else max(2 * peer.late, _LATE)
    return exchange.stop()
