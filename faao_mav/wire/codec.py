"""Packets: where they begin and end, from whom they are, and what they say, by pymavlink.

Source: MAVLink developer guide, "Serialization". What is written is always MAVLink 2.
"""

import re
from dataclasses import asdict, dataclass, fields
from typing import Any

from faao_mav.wire import messages
from faao_mav.wire.messages import Envelope, Message, WireItem
from faao_mav.wire.protocol import Address
from faao_mav.wire.signing import Signing, Verdict

_MAVLINK_1, _MAVLINK_2, _SIGNATURE = 0xFE, 0xFD, 13
"""First bytes of packets, and the bytes of a MAVLink 2 packet's signature."""

_AROUND = {_MAVLINK_1: 8, _MAVLINK_2: 12}
"""Bytes of a packet's header and checksum, by its first byte."""

_SIGNED = 0x01  # The flag, in a MAVLink 2 packet's third byte, for a signature: the only one yet.

_KINDS: dict[str, type[Message]] = {
    re.sub("(?<=[a-z])(?=[A-Z])", "_", kind.__name__).upper(): kind
    for kind in vars(messages).values()
    if isinstance(kind, type) and issubclass(kind, Message)
}
"""Message types by their MAVLink names."""

_NAMES = {kind: name for name, kind in _KINDS.items()}

_BEYOND = "mission_id"  # A field of 4 bytes behind those that the dialects of pymavlink know.


class Framer:
    """Cuts what one sender sends into packets, by the lengths that their headers tell.

    >>> framer = Framer()
    >>> framer.feed(bytes([0xFE, 1, 0, 1, 1, 0]))
    []
    >>> [packet.hex() for packet in framer.feed(bytes(3) + b"noise")]
    ['fe0100010100000000']
    """

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Return the packets that `data` completes; the beginning of one more is kept."""
        stream, packets, place = self._rest + data, [], 0
        while place < len(stream):
            if stream[place] not in _AROUND:
                place += 1
                continue
            end = place + _length_of(stream[place : place + 3])
            if end > len(stream):
                break
            # A packet with a flag that is not known is not to be read.
            if stream[place] == _MAVLINK_1 or stream[place + 2] <= _SIGNED:
                packets.append(stream[place:end])
            place = end
        self._rest = stream[place:]
        return packets

    def feed_datagram(self, data: bytes) -> list[bytes]:
        """Return the packets that the datagram `data` completes.

        Where it begins with a whole one, what is missing of the packet before it was cut off. Else
        it may go on with that one, as what comes from serial lines by a bridge does.
        """
        if 0 < _length_of(data[:3]) <= len(data):
            self._rest = b""
        return self.feed(data)


def _is_signed(packet: bytes) -> bool:
    return packet[0] == _MAVLINK_2 and bool(packet[2] & _SIGNED)


def sender_of(packet: bytes) -> Address:
    """Return who says that it sent `packet`."""
    system, component = packet[3:5] if packet[0] == _MAVLINK_1 else packet[5:7]
    return Address(system, component)


def message_id(packet: bytes) -> int:
    """Return the number of the message in `packet`."""
    return packet[5] if packet[0] == _MAVLINK_1 else int.from_bytes(packet[7:10], "little")


def _length_of(header: bytes) -> int:
    """Return how long the packet is that begins with the three bytes `header`, or with fewer.

    It is 0 where none begins.
    """
    if not header or header[0] not in _AROUND:
        return 0
    if len(header) < 3:
        return 3
    return header[1] + _AROUND[header[0]] + _SIGNATURE * _is_signed(header)


@dataclass(frozen=True, slots=True)
class Packet:
    """One valid packet: its bytes, and what it says if that is known here."""

    raw: bytes
    envelope: Envelope | None


class Codec:
    """One end of a link: writes packets as `address`, reads those of others.

    With `signing` packets are signed, and those passed over that are not, or that are old. `heard`
    has what the messages known here were, whether or not they were passed over: without `signing`,
    "signed" and "unsigned" are about whether there is a signature. `modern` has who has spoken
    MAVLink 2.
    """

    def __init__(self, address: Address, signing: Signing | None = None) -> None:
        from pymavlink.dialects.v20 import development  # common, and CURRENT_MODE

        self.address, self._signing = address, signing
        self.heard: set[Verdict] = set()
        self.modern: set[Address] = set()
        self._dialect: Any = development
        self._reader: Any = development.MAVLink(None)  # without a key: `signing` judges
        self._mav: Any = development.MAVLink(None, address.system, address.component)
        if signing is not None:
            self._mav.signing.secret_key = signing.key
            self._mav.signing.sign_outgoing = True

    def pack(self, message: Message) -> bytes:
        """Return the packet that carries `message`; fields that it does not have are zeros."""
        name, values = _NAMES[type(message)], dict(vars(message))
        if (target := values.get("target")) is not None:
            values |= {"target_system": target.system, "target_component": target.component}
        if (item := values.get("item")) is not None:
            values |= asdict(item)
            values |= {f"param{number}": value for number, value in enumerate(item.params, 1)}
        kind = getattr(self._dialect, f"MAVLink_{name.lower()}_message")
        numbers: list[Any] = []
        for field, length in zip(kind.ordered_fieldnames, kind.array_lengths, strict=True):
            value = values.get(field, 0)
            if isinstance(value, str):
                numbers.append(value.encode("ascii", "replace")[:length])
            else:
                numbers += [value] * max(length, 1)
        payload = kind.unpacker.pack(*numbers)
        if _BEYOND in values:
            payload += values[_BEYOND].to_bytes(4, "little")
        if self._signing is not None:
            self._mav.signing.timestamp = self._signing.next_tick()
        packet = self._dialect.MAVLink_message(kind.id, name)
        content = packet._pack(self._mav, kind.crc_extra, payload)
        self._mav.seq = (self._mav.seq + 1) % 256
        return bytes(content)

    def parse(self, data: bytes, origin: str = "") -> list[Packet]:
        """Return the packets in `data`, from `origin`; damaged or cut off ones are passed over."""
        found = []
        for raw in Framer().feed(data):
            try:
                message = self._reader.decode(bytearray(raw))
            except self._dialect.MAVError:
                continue
            sender = sender_of(raw)
            verdict: Verdict = "unsigned"
            if _is_signed(raw):
                verdict = "signed" if self._signing is None else self._signing.judge(raw, sender)
            if raw[0] == _MAVLINK_2:
                self.modern.add(sender)
            envelope = _envelope(message, raw, origin)
            if envelope is not None:
                self.heard.add(verdict)
            if self._signing is None or verdict == "signed":
                found.append(Packet(raw, envelope))
        return found


def _envelope(packet: Any, raw: bytes, origin: str) -> Envelope | None:
    """Return what `packet` says, None where its message is not known here."""
    kind = _KINDS.get(packet.get_type())
    if kind is None:
        return None
    values = {field.name: getattr(packet, field.name, 0) for field in fields(kind)}
    for name, value in values.items():
        if isinstance(value, str):  # without what moves a terminal's cursor
            values[name] = "".join(c if c.isprintable() else " " for c in value)
    if "target" in values:
        values["target"] = Address(packet.target_system, packet.target_component)
    if "item" in values:
        params = packet.param1, packet.param2, packet.param3, packet.param4
        place, flags = (packet.x, packet.y, packet.z), (packet.current, packet.autocontinue)
        values["item"] = WireItem(packet.command, packet.frame, params, *place, *flags)
    if _BEYOND in values and raw[0] == _MAVLINK_2:
        payload = raw[10 : 10 + raw[1]]
        values[_BEYOND] = int.from_bytes(payload[packet.unpacker.size :][:4], "little")
    return Envelope(sender_of(raw), kind(**values), origin)
