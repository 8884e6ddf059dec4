"""Packets to messages and back, by pymavlink, always MAVLink 2."""

import hashlib
import math
import struct
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
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    Row,
)
from faao_mav.mavlink.rows import coordinate_scale
from faao_mav.mavlink.transfer.protocol import Address

KEY_BYTES = 32
_SIGNING_EPOCH = 1_420_070_400  # 2015-01-01, when the clock of signatures starts
_SIGNING_TICKS = 100_000  # per second

_PLAIN: dict[str, type[Any]] = {
    "HEARTBEAT": messages.Heartbeat,
    "STATUSTEXT": messages.Statustext,
    "MISSION_REQUEST_LIST": messages.MissionRequestList,
    "MISSION_WRITE_PARTIAL_LIST": messages.MissionWritePartialList,
    "MISSION_CLEAR_ALL": messages.MissionClearAll,
    "MISSION_SET_CURRENT": messages.MissionSetCurrent,
    "MISSION_CURRENT": messages.MissionCurrent,
    "MISSION_ITEM_REACHED": messages.MissionItemReached,
    "COMMAND_LONG": messages.CommandLong,
    "COMMAND_ACK": messages.CommandAck,
    "SET_MODE": messages.SetMode,
    "PARAM_REQUEST_LIST": messages.ParamRequestList,
    "PARAM_REQUEST_READ": messages.ParamRequestRead,
    "PARAM_SET": messages.ParamSet,
    "PARAM_VALUE": messages.ParamValue,
    "AUTOPILOT_VERSION": messages.AutopilotVersion,
    "GLOBAL_POSITION_INT": messages.GlobalPositionInt,
    "LOCAL_POSITION_NED": messages.LocalPositionNed,
    "ATTITUDE": messages.Attitude,
    "HOME_POSITION": messages.HomePosition,
}
"""Messages whose fields travel as they are."""

_NAMES = {kind: name for name, kind in _PLAIN.items()}
_IDENTIFIED: dict[str, type[MissionCount | MissionAck]] = {
    "MISSION_COUNT": MissionCount,
    "MISSION_ACK": MissionAck,
}
"""Messages that end in an opaque_id, which the dialects of pymavlink leave out."""


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
        packet: bytes = self._encode(message)
        self._mav.seq = (self._mav.seq + 1) % 256
        return packet

    def parse(self, data: bytes) -> list[Packet]:
        """Return the packets completed by `data`; what is damaged is passed over."""
        found = [m for m in self._mav.parse_buffer(data) or [] if m.get_type() != "BAD_DATA"]
        if self._mav.signing.secret_key is None and self._mav.signing.sig_count:
            self.lacks_key = True
        return [Packet(bytes(m.get_msgbuf()), self._envelope(m)) for m in found]

    def _encode(self, message: Message) -> bytes:
        mav, dialect = self._mav, self._dialect
        match message:
            case MissionItemInt():
                return bytes(_encode_item(dialect, message).pack(mav))
            case MissionRequestInt():
                kind = (
                    dialect.MAVLink_mission_request_message
                    if message.legacy
                    else dialect.MAVLink_mission_request_int_message
                )
                target = (message.target_system, message.target_component)
                return bytes(kind(*target, message.seq, message.mission_type).pack(mav))
            case MissionCount(system, component, count, mission_type, opaque_id):
                base = dialect.MAVLink_mission_count_message(system, component, count, mission_type)
                payload = struct.pack("<HBBBI", count, system, component, mission_type, opaque_id)
                return bytes(base._pack(mav, base.crc_extra, payload))
            case MissionAck(system, component, result, mission_type, opaque_id):
                base = dialect.MAVLink_mission_ack_message(system, component, result, mission_type)
                payload = struct.pack("<BBBBI", system, component, result, mission_type, opaque_id)
                return bytes(base._pack(mav, base.crc_extra, payload))
        name = _NAMES[type(message)]
        kind = getattr(dialect, f"MAVLink_{name.lower()}_message")
        return bytes(kind(*_values(kind, message)).pack(mav))

    def _envelope(self, found: Any) -> Envelope | None:
        name = found.get_type()
        message: Message
        if name in _PLAIN:
            kind = _PLAIN[name]
            message = kind(*(_clean(getattr(found, field.name)) for field in fields(kind)))
        elif name in _IDENTIFIED:
            message = _IDENTIFIED[name](
                found.target_system,
                found.target_component,
                found.count if name == "MISSION_COUNT" else found.type,
                found.mission_type,
                _opaque_id(found),
            )
        elif name in ("MISSION_REQUEST", "MISSION_REQUEST_INT"):
            message = MissionRequestInt(
                found.target_system,
                found.target_component,
                found.seq,
                found.mission_type,
                legacy=name == "MISSION_REQUEST",
            )
        elif name in ("MISSION_ITEM", "MISSION_ITEM_INT"):
            item = _decode_item(found, legacy=name == "MISSION_ITEM")
            if item is None:
                return None
            message = item
        else:
            return None
        return Envelope(Address(found.get_srcSystem(), found.get_srcComponent()), message)


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


def key_of_phrase(phrase: str) -> bytes:
    """Return the signing key that ground stations make of a pass phrase: its SHA-256."""
    return hashlib.sha256(phrase.encode()).digest()


def _encode_item(dialect: Any, item: MissionItemInt) -> Any:
    row = item.row
    x: float = row.x
    y: float = row.y
    kind = dialect.MAVLink_mission_item_int_message
    if item.legacy:
        kind = dialect.MAVLink_mission_item_message
        scale = coordinate_scale(row.frame)
        x, y = row.x / scale, row.y / scale
    head = (item.target_system, item.target_component, item.seq, row.frame, row.command)
    flags = (row.current, row.autocontinue)
    return kind(*head, *flags, *row.params, x, y, row.z, item.mission_type)


def _decode_item(found: Any, *, legacy: bool) -> MissionItemInt | None:
    x, y = found.x, found.y
    if legacy:
        if not (math.isfinite(x) and math.isfinite(y)):
            return None
        scale = coordinate_scale(found.frame)
        x, y = round(x * scale), round(y * scale)
    params = (found.param1, found.param2, found.param3, found.param4)
    flags = (found.current, found.autocontinue)
    row = Row(found.command, found.frame, params, x, y, found.z, *flags)
    target = (found.target_system, found.target_component)
    return MissionItemInt(*target, found.seq, found.mission_type, row, legacy)


def _values(kind: Any, message: Message) -> list[Any]:
    """Return the arguments of pymavlink's `kind` for `message`; fields unknown here are zeros."""
    sizes = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    values = []
    for name, type_name in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        value = getattr(message, name, None)
        if isinstance(value, str):
            value = value.encode("ascii", "replace")[: sizes[name]]
        elif value is None:
            value = 0
            if sizes[name]:
                value = b"" if type_name == "char" else [0] * sizes[name]
        values.append(value)
    return values


def _clean(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.split(b"\0", 1)[0].decode("ascii", "replace")
    return value


def _opaque_id(found: Any) -> int:
    """Return the last field of a packet that is longer than pymavlink knows it, or 0."""
    packet = bytes(found.get_msgbuf())
    if packet[0] != 0xFD:
        return 0
    payload = packet[10 : 10 + packet[1]]
    tail = payload[found.unpacker.size :][:4]
    return int.from_bytes(tail, "little")
