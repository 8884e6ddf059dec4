"""Signatures: the key, and up to when packets under it have been seen.

Source: MAVLink developer guide, "Message Signing". Times are ticks of 10 microseconds since 2015.
"""

import contextlib
import hashlib
import hmac
import os
import stat
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal, TypeAlias

from faao_mav.errors import InputError
from faao_mav.files import read_bytes, write_whole
from faao_mav.wire.protocol import Address

Verdict: TypeAlias = Literal["signed", "unsigned", "forged", "old"]
"""What is to be said of a packet where packets are to be signed; "forged" is of another key."""

_KEY_BYTES = 32
_LARGEST_FILE = 1024  # Bytes of a key file that are read, at most: above 64 digits and some blanks.

_EPOCH, _TICKS, _LAST_TICK = 1_420_070_400, 100_000, 2**48 - 1
"""Seconds from 1970 to the start of 2015, ticks in a second, and the last one."""

_LATE = 60 * _TICKS
"""How far behind this clock the first packet of a sender may be: the guide's minute, in ticks."""


class Signing:
    """The `key` of a link, and the time of the last packet that was signed with it.

    A packet is taken once, and only if it is younger than all before it of its sender: in this
    session, and by `latest` in those before. The guide tells streams of one sender apart by a link
    number that the sender chooses; here they share one time, so that no number makes old packets
    new.
    """

    def __init__(self, key: bytes, latest: int = 0, clock: Callable[[], float] = time.time) -> None:
        self.key, self.latest, self._clock = key, latest, clock
        self._remembered = latest
        self._seen: dict[Address, int] = {}

    def next_tick(self) -> int:
        """Return the time of the next packet to send: now, and after every packet so far."""
        self.latest = min(max(self.latest + 1, self._now()), _LAST_TICK)
        return self.latest

    def judge(self, packet: bytes, sender: Address) -> Verdict:
        """Return what `packet`, which has a signature, is.

        A "signed" one is taken, and would be "old" the next time.
        """
        digest = hashlib.sha256(self.key + packet[:-6]).digest()
        if not hmac.compare_digest(digest[:6], packet[-6:]):
            return "forged"
        tick = int.from_bytes(packet[-12:-6], "little")
        if tick <= self._seen.get(sender, max(self._remembered, self._now() - _LATE)):
            return "old"
        self._seen[sender] = tick
        self.latest = max(self.latest, tick)
        return "signed"

    def _now(self) -> int:
        return int((self._clock() - _EPOCH) * _TICKS)


def read_signing(path: Path) -> Signing:
    """Return the key in the file `path` (32 bytes, or 64 hexadecimal digits), with its last time.

    The time is in the file of `remember`, if there is one. Raises `InputError`, also for a key that
    others may read; the content is never shown.
    """
    expected = "a signing key: 32 bytes, or 64 hexadecimal digits"
    path = path.absolute()  # whose name is not the one of standard input
    key = read_bytes(path, _LARGEST_FILE, expected)
    mode = path.stat().st_mode
    if os.name == "posix" and mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise InputError(
            f"{path}: others than its owner have access (mode {stat.S_IMODE(mode):o}); a signing "
            f"key is its owner's alone: chmod 600 {path}"
        )
    if len(key) != _KEY_BYTES:
        with contextlib.suppress(ValueError):
            key = bytes.fromhex(key.decode("ascii").strip())
    if len(key) != _KEY_BYTES:
        raise InputError(f"{path}: expected {expected}")
    last = _last_of(path)
    if not last.exists():
        return Signing(key)
    expected = f"the time of the last packet signed with the key, a number of at most {_LAST_TICK}"
    digits = read_bytes(last, _LARGEST_FILE, expected)
    if not digits.strip().isdigit() or int(digits) > _LAST_TICK:
        raise InputError(f"{last}: expected {expected}")
    return Signing(key, int(digits))


def remember(path: Path, signing: Signing) -> None:
    """Write the time of the last packet beside the key, for the next session.

    Where that folder cannot be written to, nothing is: a session asks for something fresh anyway.
    """
    with contextlib.suppress(InputError):
        write_whole(_last_of(path), f"{signing.latest}\n".encode())


def _last_of(path: Path) -> Path:
    return path.with_name(path.name + ".last")
