"""A machine on a real link, and the log of what passes it."""

import os
import struct
import time
from collections.abc import Callable, Sequence, Set
from io import FileIO
from pathlib import Path
from typing import TypeAlias, TypeVar

from faao_mav.errors import InputError, LinkError
from faao_mav.files import check_writable
from faao_mav.mavlink.codec import Codec
from faao_mav.mavlink.framing import message_id
from faao_mav.mavlink.machine import Machine
from faao_mav.mavlink.messages import Heartbeat, Message
from faao_mav.mavlink.protocol import (
    GROUND_STATION,
    GROUND_STATION_TYPE,
    NO_AUTOPILOT,
    Address,
    MavState,
)
from faao_mav.mavlink.signing import Signing, Verdict
from faao_mav.mavlink.transport import Transport, open_transport

T = TypeVar("T")

Observe: TypeAlias = Callable[[str, int, int], object]
"""Told what is going on, how much of it is done, and of how much."""

_BEAT = 1.0
"""Seconds between two heartbeats: what the MAVLink guide asks for."""

_SETUP_SIGNING = 256
"""The number of the message SETUP_SIGNING."""


class Tlog:
    """A `.tlog` file: before each packet the time since 1970, 8 bytes, big-endian, microseconds.

    MAVProxy and Mission Planner write and read such files. Only its owner may read this one, and it
    holds no SETUP_SIGNING, which carries a key. An older log of the name stays until the first
    packet is received. `failure` says why the log ends early, if it does: the link goes on.

    Raises `InputError` if the file cannot be written, or by its name is none of these: a slip of
    the pen must not replace the mission.
    """

    def __init__(self, path: Path, clock: Callable[[], float] = time.time) -> None:
        if path.suffix != ".tlog":
            raise InputError(f"--log {path}: give a name that ends in .tlog")
        check_writable(path)
        self.failure: str | None = None
        self._path, self._clock = path, clock
        self._file: FileIO | None = None
        self._waiting = b""

    def write(self, packet: bytes, *, received: bool) -> None:
        """Append `packet`, sent or received now."""
        if self.failure is not None or message_id(packet) == _SETUP_SIGNING:
            return
        self._waiting += struct.pack(">Q", int(self._clock() * 1e6)) + packet
        try:
            if received and self._file is None:
                self._file = FileIO(self._path, "w", opener=_open_for_owner)
            while self._file is not None and self._waiting:
                self._waiting = self._waiting[self._file.write(self._waiting) :]
        except OSError as error:
            self.failure = f"{self._path}: cannot be written: {error.strerror}; the log ends early"

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()


def _open_for_owner(path: str, flags: int) -> int:
    """Open a file that only its owner may read, also one that was there and others might read."""
    handle = os.open(path, flags, mode=0o600)
    Path(path).chmod(0o600)
    return handle


class WireLink:
    """A ground station's end of a link: runs machines, and says once a second that it is there.

    `log` is the exchange in a file, if there is to be one. Use the link in a `with` statement.
    """

    def __init__(
        self,
        connection: str | Transport,
        *,
        signing: Signing | None = None,
        log: Path | None = None,
        address: Address = GROUND_STATION,
    ) -> None:
        self.address = address
        self._codec = Codec(address, signing)
        self.log = None if log is None else Tlog(log)
        self._next_beat = 0.0
        self._transport = open_transport(connection) if isinstance(connection, str) else connection

    def __enter__(self) -> "WireLink":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the connection, finish the log."""
        self._transport.close()
        if self.log is not None:
            self.log.close()

    @property
    def heard(self) -> Set[Verdict]:
        """What signatures the packets of others had, as `Codec.heard`."""
        return self._codec.heard

    def run(self, machine: Machine[T], observe: Observe | None = None) -> T:
        """Run `machine` to its end and return the outcome.

        Interrupted from the keyboard it cancels the transfer first. Raises `LinkError`, which says
        what was under way.
        """
        try:
            return self._run(machine, observe)
        except (KeyboardInterrupt, LinkError) as end:
            what, done, total = machine.progress
            text = f"while {what}" + (f" at item {done} of {total}" if total else "")
            if isinstance(end, LinkError):
                raise LinkError(f"{end}, {text}") from None
            self._send(machine.cancel(time.monotonic()))
            raise LinkError(f"interrupted {text}: cancelled") from None

    def _run(self, machine: Machine[T], observe: Observe | None) -> T:
        self._beat(time.monotonic())
        self.begin(machine)
        while (outcome := machine.outcome) is None:
            self.step(machine, self._next_beat)
            self._beat(time.monotonic())
            if observe is not None:
                observe(*machine.progress)
        return outcome

    def watch(self, machine: Machine[T], observe: Callable[[], object]) -> T:
        """Run `machine` to its end and return the outcome; `observe` is called after every step.

        Interrupted from the keyboard the machine is told to cancel, and is run on until it ends.
        """
        self._beat(time.monotonic())
        self.begin(machine)
        while (outcome := machine.outcome) is None:
            try:
                self.step(machine, self._next_beat)
                self._beat(time.monotonic())
                observe()
            except KeyboardInterrupt:
                self._send(machine.cancel(time.monotonic()))
        return outcome

    def begin(self, machine: Machine[T]) -> None:
        """Start `machine`; `step` then carries it on."""
        self._send(machine.start(time.monotonic()))

    def step(self, machine: Machine[T], until: float) -> None:
        """Feed `machine` with what arrives first: packets, its deadline or the time `until`."""
        due = machine.deadline
        until = until if due is None else min(due, until)
        for data in self._transport.read(until - time.monotonic()):
            for packet in self._codec.parse(data):
                if self.log is not None:
                    self.log.write(packet.raw, received=True)
                if packet.envelope is not None and machine.outcome is None:
                    self._send(machine.on(packet.envelope, time.monotonic()))
        if machine.outcome is None:
            self._send(machine.tick(time.monotonic()))

    def _beat(self, now: float) -> None:
        if now >= self._next_beat:
            self._next_beat = now + _BEAT
            self._send([Heartbeat(GROUND_STATION_TYPE, NO_AUTOPILOT, 0, 0, MavState.ACTIVE)])

    def _send(self, messages: Sequence[Message]) -> None:
        for message in messages:
            packet = self._codec.pack(message)
            if self.log is not None:
                self.log.write(packet, received=False)
            self._transport.write(packet)
