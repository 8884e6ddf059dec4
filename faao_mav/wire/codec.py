"""Packets to messages and back, by pymavlink, always MAVLink 2."""

import re
from dataclasses import asdict, dataclass, fields
from typing import Any

from faao_mav.wire import messages
from faao_mav.wire.framing import Framer, is_signed, payload_of, sender_of
from faao_mav.wire.messages import Envelope, Message, WireItem
from faao_mav.wire.protocol import Address
from faao_mav.wire.signing import Signing, Verdict

_KINDS: dict[str, type[Message]] = {
    re.sub("(?<=[a-z])(?=[A-Z])", "_", kind.__name__).upper(): kind
    for kind in vars(messages).values()
    if isinstance(kind, type) and issubclass(kind, Message)
}
"""Message types by their MAVLink names."""

_NAMES = {kind: name for name, kind in _KINDS.items()}

_BEYOND = ("opaque_id", "mission_id")
"""Fields behind those that the dialects of pymavlink know, of 4 bytes."""


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
        payload += b"".join(
            values[name].to_bytes(4, "little") for name in _BEYOND if name in values
        )
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
            verdict: Verdict = "signed" if is_signed(raw) else "unsigned"
            if self._signing is not None:
                verdict = self._signing.judge(raw, sender_of(raw))
            if payload_of(raw) is not None:
                self.modern.add(sender_of(raw))
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
    values = {field.name: _on_one_line(getattr(packet, field.name, 0)) for field in fields(kind)}
    if "target" in values:
        values["target"] = Address(packet.target_system, packet.target_component)
    if "item" in values:
        p = packet
        params = (p.param1, p.param2, p.param3, p.param4)
        flags = (p.current, p.autocontinue)
        values["item"] = WireItem(p.command, p.frame, params, p.x, p.y, p.z, *flags)
    for name in values.keys() & _BEYOND:
        rest = (payload_of(raw) or b"")[packet.unpacker.size :]
        values[name] = int.from_bytes(rest[:4], "little")
    return Envelope(sender_of(raw), kind(**values), origin)


def _on_one_line(value: Any) -> Any:
    """Return a text without what moves a terminal's cursor, and anything else as it is."""
    is_text = isinstance(value, str)
    return "".join(c if c.isprintable() else " " for c in value) if is_text else value
