"""A machine on a real link, and the log of what passes it."""

import struct
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeAlias, TypeVar

from faao_mav.errors import InputError, LinkError
from faao_mav.files import check_writable
from faao_mav.mavlink.codec import Codec
from faao_mav.mavlink.machine import Machine
from faao_mav.mavlink.messages import Heartbeat, Message
from faao_mav.mavlink.protocol import (
    GROUND_STATION,
    GROUND_STATION_TYPE,
    NO_AUTOPILOT,
    Address,
    MavState,
)
from faao_mav.mavlink.transport import Transport, open_transport

T = TypeVar("T")

Observe: TypeAlias = Callable[[str, int, int], object]
"""Told what is going on, how much of it is done, and of how much."""

_BEAT = 1.0
"""Seconds between two heartbeats: what the MAVLink guide asks for."""


class Tlog:
    """A `.tlog` file: before each packet the time since 1970, 8 bytes, big-endian, microseconds.

    Raises `InputError` if the file cannot be written, or by its name is none of these: a slip of
    the pen must not replace the mission. MAVProxy and Mission Planner write and read such files.
    """

    def __init__(self, path: Path, clock: Callable[[], float] = time.time) -> None:
        if path.suffix != ".tlog":
            raise InputError(f"--log {path}: give a name that ends in .tlog")
        check_writable(path)
        try:
            self._file = path.open("wb")
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None
        self._clock = clock

    def write(self, packet: bytes) -> None:
        """Append `packet`, sent or received now."""
        self._file.write(struct.pack(">Q", int(self._clock() * 1e6)) + packet)

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class WireLink:
    """A ground station's end of a link: runs machines, and says once a second that it is there.

    `log` is a file for the exchange. Use it in a `with` statement.
    """

    def __init__(
        self,
        connection: str | Transport,
        *,
        key: bytes | None = None,
        log: Path | None = None,
        address: Address = GROUND_STATION,
    ) -> None:
        self.address = address
        self._codec = Codec(address, key)
        self._log = None if log is None else Tlog(log)
        self._next_beat = 0.0
        try:
            self._transport = (
                open_transport(connection) if isinstance(connection, str) else connection
            )
        except Exception:
            if self._log is not None:
                self._log.close()
            raise

    def __enter__(self) -> "WireLink":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the connection, finish the log."""
        self._transport.close()
        if self._log is not None:
            self._log.close()

    @property
    def lacks_key(self) -> bool:
        """Whether others on the link sign their packets, and this end has no key."""
        return self._codec.lacks_key

    def run(self, machine: Machine[T], observe: Observe | None = None) -> T:
        """Run `machine` to its end and return the outcome.

        Interrupted from the keyboard it cancels the transfer first. Raises `LinkError`.
        """
        try:
            return self._run(machine, observe)
        except KeyboardInterrupt:
            what, done, total = machine.progress
            self._send(machine.cancel(time.monotonic()))
            at = f" at item {done} of {total}" if total else ""
            left = ""
            if what.startswith(("uploading", "clearing")):
                left = ". What the vehicle holds now is not known: upload again, or download it"
            raise LinkError(f"interrupted while {what}{at}: cancelled{left}") from None

    def _run(self, machine: Machine[T], observe: Observe | None) -> T:
        self._beat(time.monotonic())
        self.begin(machine)
        while (outcome := machine.outcome) is None:
            self.step(machine, self._next_beat)
            self._beat(time.monotonic())
            if observe is not None:
                observe(*machine.progress)
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
                if self._log is not None:
                    self._log.write(packet.raw)
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
            if self._log is not None:
                self._log.write(packet)
            self._transport.write(packet)
