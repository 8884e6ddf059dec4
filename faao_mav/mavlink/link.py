"""A machine on a real link."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import TypeAlias, TypeVar

from faao_mav.errors import LinkError
from faao_mav.mavlink.codec import Codec
from faao_mav.mavlink.messages import Heartbeat, Message
from faao_mav.mavlink.tlog import Tlog
from faao_mav.mavlink.transfer.protocol import GROUND_STATION, Address, Autopilot, State
from faao_mav.mavlink.transfer.transfer import Machine
from faao_mav.mavlink.transport import Transport, open_transport

T = TypeVar("T")
Observe: TypeAlias = Callable[[str, int, int], object]
"""Told what is going on, how much of it is done, and of how much."""

_GCS = 6  # MAV_TYPE
_BEAT = 1.0  # s


class Link:
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

    def __enter__(self) -> "Link":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
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
        """Start `machine`, for who calls `step` himself."""
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
            self._send([Heartbeat(_GCS, Autopilot.INVALID, 0, 0, State.ACTIVE)])

    def _send(self, messages: Sequence[Message]) -> None:
        for message in messages:
            packet = self._codec.pack(message)
            if self._log is not None:
                self._log.write(packet)
            self._transport.write(packet)
