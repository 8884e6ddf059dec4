"""The messages in the logs of flights, whatever else is in the files.

What is no message is passed over. `InputError` is raised where there is more of that than in a log,
or where there are more messages than of any flight: time stays in proportion, memory below 500 MB.

Sources: ArduPilot, "Log messages"; MAVLink, "File formats"; PX4, "ULog file format".
"""

import io
import re
import struct
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

from faao_mav.errors import InputError
from faao_mav.mavlink.framing import length_of, message_id

_BLOCK, _LONGEST = 1_000_000, 300
"""Bytes that are read at once, chosen; and more than any message of a `.bin` or a `.tlog` has."""

_MOST_NOISE = 10_000_000
"""Bytes that are no message, of which a log has no more; chosen: passed over in a few seconds."""

_MOST_DAMAGED = 10_000
"""Messages with a wrong checksum, of which a log has no more: who writes it checks them; chosen."""

_MOST_MESSAGES = 1_000_000
"""Messages about the flight, of which a log has no more; chosen: nine hours, thrice at 10 Hz."""

_MOST_ULOG = 100_000_000
"""Bytes about the flight in a `.ulg`, which has no more; chosen: `_MOST_MESSAGES` of positions."""

_FMT = 0x80
_FORMAT = struct.Struct("<3xBB4s16s64s")
"""FMT, which describes the messages of a `.bin`: number, length, name, format, columns."""

_TIMED = 11
"""Bytes of a message of a `.bin` that has a time and nothing else; all but FMT have one."""

_LETTERS = {
    **{letter: (letter, 1.0) for letter in "bBhHiIfdqQ"},
    "a": ("64s", 1.0),
    "n": ("4s", 1.0),
    "N": ("16s", 1.0),
    "Z": ("64s", 1.0),
    "M": ("B", 1.0),
    "c": ("h", 0.01),
    "C": ("H", 0.01),
    "e": ("i", 0.01),
    "E": ("I", 0.01),
    "L": ("i", 1e-7),
    "g": ("e", 1.0),
}
"""Letters of a format: what each is for `struct`, and the unit of its numbers."""

_ULOG_HEADER, _ULOG_KINDS = 16, b"ABCDFILMOPQRS"
"""Bytes before the first message of a `.ulg`; the kinds of messages that there are."""


def bin_messages(path: Path, names: Collection[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield name and values by column of each message of these `names` in an ArduPilot's `.bin`."""
    lengths, readers, count = {_FMT: _FORMAT.size}, dict[int, _Reader](), 0

    def length(data: bytes, at: int) -> int:
        return lengths.get(data[at + 2], 0) if data.startswith(b"\xa3\x95", at) else 0

    with path.open("rb") as file:
        for packet in _packets(path, file, re.compile(rb"\xa3\x95"), length):
            if packet[2] == _FMT:
                number, size, *texts = _FORMAT.unpack(packet)
                name, letters, columns = map(_text, texts)
                if number != _FMT and size >= _TIMED:
                    lengths[number] = size
                    readers.pop(number, None)
                    if name in names:
                        readers[number] = _Reader(name, letters, columns.split(","), size)
            elif (reader := readers.get(packet[2])) is not None:
                count = _one_more(path, count)
                yield reader.name, reader.read(packet)


class _Reader:
    """Reads messages of one format in a `.bin`."""

    def __init__(self, name: str, letters: str, columns: Sequence[str], size: int) -> None:
        self.name, self._columns = name, columns
        kinds, self._units = zip(*(_LETTERS[letter] for letter in letters), strict=True)
        self._struct = struct.Struct("<3x" + "".join(kinds))
        if self._struct.size != size or len(columns) != len(letters):
            raise ValueError(f"{name!r} has {size} bytes, its format {letters!r} has others")

    def read(self, packet: bytes) -> dict[str, Any]:
        values = zip(self._columns, self._struct.unpack(packet), self._units, strict=True)
        return {
            column: _text(value) if isinstance(value, bytes) else value * unit
            for column, value, unit in values
        }


def tlog_messages(path: Path, names: Collection[str]) -> Iterator[Any]:
    """Yield the messages of these `names` in a `.tlog`, as pymavlink has them."""
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    numbers = {getattr(dialect, f"MAVLINK_MSG_ID_{name}") for name in names}
    reader, count, damaged = dialect.MAVLink(None), 0, 0

    def length(data: bytes, at: int) -> int:
        packet = length_of(data[at + 8 : at + 11])  # after the time
        return packet and 8 + packet

    with path.open("rb") as file:
        for packet in _packets(path, file, re.compile(rb"(?s).{8}[\xfd\xfe]"), length):
            if message_id(packet[8:]) in numbers:
                try:
                    message = reader.decode(bytearray(packet[8:]))
                except dialect.MAVError:
                    damaged += 1
                    if damaged > _MOST_DAMAGED:
                        raise _no_log(path, f"{_MOST_DAMAGED:,} damaged messages") from None
                else:
                    count = _one_more(path, count)
                    yield message


def sound_ulog(path: Path, topics: Collection[str]) -> io.BytesIO:
    """Return what a `.ulg` has of `topics` and parameters, up to where it ends or is damaged."""
    kept, numbers, count = io.BytesIO(), set[bytes](), 0
    names = {topic.encode() for topic in topics}
    with path.open("rb") as file:
        kept.write(file.read(_ULOG_HEADER))
        while len(head := file.read(3)) == 3:
            size, kind = head[0] + 256 * head[1], head[2:]
            content = file.read(size)
            if kind not in _ULOG_KINDS or len(content) < size:
                break
            if kind == b"A" and content[3:] in names:
                numbers.add(content[1:3])
            about = content[1:3] if kind == b"A" else content[:2]
            if kind in b"FP" or (kind in b"AD" and about in numbers):
                kept.write(head + content)
                count = _one_more(path, count)
                if kept.tell() > _MOST_ULOG:
                    raise _no_log(path, f"{_MOST_ULOG:,} bytes of positions, winds and parameters")
    kept.seek(0)
    return kept


def _one_more(path: Path, count: int) -> int:
    if count == _MOST_MESSAGES:
        raise _no_log(path, f"{count:,} positions, winds and parameters")
    return count + 1


def _packets(
    path: Path, file: BinaryIO, start: re.Pattern[bytes], length: Callable[[bytes, int], int]
) -> Iterator[bytes]:
    """Yield the messages in `file`.

    `length(data, at)` is how long the one is that begins there, 0 where none does; `start` is how
    one looks.
    """
    data, at, noise = b"", 0, 0
    while True:
        block = file.read(_BLOCK)
        data, at = data[at:] + block, 0
        last = len(data) - _LONGEST  # what begins before that is there whole
        while at < (last if block else last + _LONGEST - 10):
            if size := length(data, at):
                if at + size > len(data):
                    return
                yield data[at : at + size]
                at += size
                continue
            found = start.search(data, at + 1)
            place = found.start() if found else max(at + 1, len(data) - 10)
            noise, at = noise + place - at, place
            if noise > _MOST_NOISE:
                raise _no_log(path, f"{_MOST_NOISE:,} bytes that are no messages")
        if not block:
            return


def _no_log(path: Path, what: str) -> InputError:
    return InputError(f"{path}: more than {what}; expected the log of a flight")


def _text(value: bytes) -> str:
    return value.split(b"\0")[0].decode("ascii", errors="replace")
