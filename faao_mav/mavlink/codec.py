"""Packets to messages and back, by pymavlink, always MAVLink 2."""

import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from faao_mav.errors import InputError
from faao_mav.mavlink import messages
from faao_mav.mavlink.messages import (
    Envelope,
    Message,
    MissionItemInt,
    MissionRequestInt,
    WireItem,
)
from faao_mav.mavlink.protocol import Address
from faao_mav.mavlink.wire_items import coordinate_scale

KEY_BYTES = 32
"""Length of a signing key (MAVLink 2, "Message Signing")."""

_SIGNING_EPOCH = 1_420_070_400
"""Seconds from 1970 to the start of 2015, where the clock of signatures starts."""

_SIGNING_TICKS = 100_000
"""Ticks of the clock of signatures in a second."""

_KINDS: dict[str, type[Message]] = {
    re.sub("(?<=[a-z])(?=[A-Z])", "_", kind.__name__).upper(): kind
    for kind in vars(messages).values()
    if isinstance(kind, type) and issubclass(kind, Message)
}
"""Message types by their MAVLink names."""

_NAMES = {kind: name for name, kind in _KINDS.items()}
_LEGACY: dict[str, type[Message]] = {
    "MISSION_REQUEST": MissionRequestInt,
    "MISSION_ITEM": MissionItemInt,
}
"""Predecessors with the same fields."""


@dataclass(frozen=True, slots=True)
class Packet:
    """One valid packet: its bytes, and what it says if that is known here."""

    raw: bytes
    envelope: Envelope | None


class Codec:
    """One end of a link: writes packets as `address`, reads those of others.

    With `key` (32 bytes) packets are signed, and unsigned or wrongly signed ones are passed over.
    `clock` gives seconds since 1970, for signatures. `lacks_key` says that others sign, and that
    there is no key here.
    """

    def __init__(
        self,
        address: Address,
        key: bytes | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        from pymavlink.dialects.v20 import common

        self.address, self._clock = address, clock
        self.lacks_key = False
        self._dialect: Any = common
        self._mav: Any = common.MAVLink(None, address.system, address.component)
        self._mav.robust_parsing = True
        if key is not None:
            self._mav.signing.secret_key = key
            self._mav.signing.sign_outgoing = True

    def pack(self, message: Message) -> bytes:
        """Return the packet that carries `message`."""
        signing = self._mav.signing
        if signing.sign_outgoing:
            ticks = int((self._clock() - _SIGNING_EPOCH) * _SIGNING_TICKS)
            signing.timestamp = max(signing.timestamp, ticks)
        packet = self._encode(message)
        self._mav.seq = (self._mav.seq + 1) % 256
        return packet

    def parse(self, data: bytes) -> list[Packet]:
        """Return the packets completed by `data`; what is damaged is passed over."""
        found = [m for m in self._mav.parse_buffer(data) or [] if m.get_type() != "BAD_DATA"]
        if self._mav.signing.secret_key is None and self._mav.signing.sig_count:
            self.lacks_key = True
        return [Packet(bytes(m.get_msgbuf()), self._envelope(m)) for m in found]

    def _encode(self, message: Message) -> bytes:
        name = _NAMES[type(message)]
        values = {field.name: getattr(message, field.name) for field in fields(message)}
        if values.pop("legacy", False):
            name = name.removesuffix("_INT")
        if (target := values.pop("target", None)) is not None:
            values |= {"target_system": target.system, "target_component": target.component}
        if (item := values.pop("item", None)) is not None:
            values |= _item_values(item, exact=name.endswith("_INT"))
        kind = getattr(self._dialect, f"MAVLink_{name.lower()}_message")
        packet = kind(*_arguments(kind, values))
        if (opaque_id := values.get("opaque_id")) is None:
            return bytes(packet.pack(self._mav))
        # The last field of the message, which the dialects of pymavlink leave out.
        known = kind.unpacker.pack(*(values[field] for field in kind.ordered_fieldnames))
        payload = known + opaque_id.to_bytes(4, "little")
        return bytes(packet._pack(self._mav, packet.crc_extra, payload))

    def _envelope(self, packet: Any) -> Envelope | None:
        name = packet.get_type()
        kind = _KINDS.get(name) or _LEGACY.get(name)
        if kind is None:
            return None
        legacy = name in _LEGACY
        values: dict[str, Any] = {}
        for field in fields(kind):
            match field.name:
                case "target":
                    values["target"] = Address(packet.target_system, packet.target_component)
                case "opaque_id":
                    values["opaque_id"] = _opaque_id(packet)
                case "legacy":
                    values["legacy"] = legacy
                case "item":
                    values["item"] = _wire_item(packet, exact=not legacy)
                    if values["item"] is None:
                        return None
                case plain:
                    values[plain] = _text_or_number(getattr(packet, plain))
        sender = Address(packet.get_srcSystem(), packet.get_srcComponent())
        return Envelope(sender, kind(**values))


def read_key(path: Path) -> bytes:
    """Return the signing key in the file `path`: 32 bytes, or 64 hexadecimal digits.

    Raises `InputError`; the content is never shown.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    if len(content) == KEY_BYTES:
        return content
    try:
        key = bytes.fromhex(content.decode("ascii").strip())
    except ValueError:
        key = b""
    if len(key) != KEY_BYTES:
        raise InputError(
            f"{path}: {len(content)} bytes; expected a signing key: 32 bytes, or 64 hexadecimal "
            "digits"
        )
    return key


def _item_values(item: WireItem, *, exact: bool) -> dict[str, Any]:
    """Return the fields of MISSION_ITEM_INT, or of MISSION_ITEM (not `exact`), for `item`."""
    values = {field.name: getattr(item, field.name) for field in fields(item)}
    values |= {f"param{number}": value for number, value in enumerate(item.params, start=1)}
    if exact:
        return values
    scale = coordinate_scale(item.frame)
    return values | {"x": item.x / scale, "y": item.y / scale}


def _wire_item(packet: Any, *, exact: bool) -> WireItem | None:
    """Return the item that MISSION_ITEM_INT, or MISSION_ITEM (not `exact`), carries."""
    x, y = packet.x, packet.y
    if not exact:
        if not (math.isfinite(x) and math.isfinite(y)):
            return None
        scale = coordinate_scale(packet.frame)
        x, y = round(x * scale), round(y * scale)
    params = (packet.param1, packet.param2, packet.param3, packet.param4)
    flags = (packet.current, packet.autocontinue)
    return WireItem(packet.command, packet.frame, params, x, y, packet.z, *flags)


def _arguments(kind: Any, known: dict[str, Any]) -> list[Any]:
    """Return the arguments of pymavlink's `kind`; fields that are not `known` are zeros."""
    sizes = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    arguments = []
    for name, type_name in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        value = known.get(name)
        if isinstance(value, str):
            value = value.encode("ascii", "replace")[: sizes[name]]
        elif value is None:
            value = 0
            if sizes[name]:
                value = b"" if type_name == "char" else [0] * sizes[name]
        arguments.append(value)
    return arguments


def _text_or_number(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.split(b"\0", 1)[0].decode("ascii", "replace")
    return value


def _opaque_id(packet: Any) -> int:
    """Return the last field of a packet that is longer than pymavlink knows it, or 0."""
    raw = bytes(packet.get_msgbuf())
    if raw[0] != 0xFD:
        return 0
    payload = raw[10 : 10 + raw[1]]
    tail = payload[packet.unpacker.size :][:4]
    return int.from_bytes(tail, "little")
