"""A machine on a real link, and the log of what passes it."""

import secrets
import struct
import time
from collections.abc import Callable, Sequence
from io import FileIO
from pathlib import Path
from typing import Any, Self, TypeAlias, TypeVar

from faao_mav.errors import HangUp, LinkError
from faao_mav.files import check_ending, check_writable
from faao_mav.wire import protocol
from faao_mav.wire.codec import Codec, Packet, message_id, sender_of
from faao_mav.wire.machine import Machine, Script, Talk
from faao_mav.wire.messages import Heartbeat, Message
from faao_mav.wire.protocol import Address
from faao_mav.wire.signing import Signing
from faao_mav.wire.transport import Origin, Transport, open_transport

T = TypeVar("T")

Observe: TypeAlias = Callable[[str, int, int], object]
"""Told what is going on, how much of it is done, and of how much."""

_BEAT = 1.0
"""Seconds between two heartbeats, what the MAVLink guide asks for, and between two looks at how
far a machine is."""

_SHOWN = 3  # Other origins of the vehicle's packets that are told, at most. Chosen.
_SETUP_SIGNING = 256  # The number of the message SETUP_SIGNING.


class Tlog:
    """A `.tlog` file: before each packet the time since 1970, 8 bytes, big-endian, microseconds.

    MAVProxy and Mission Planner write and read such files. Only its owner may read this one, and it
    holds no SETUP_SIGNING, which carries a key. It begins with the first packet that is received:
    until then an older log of the name stays. `failure` says why the log ends early, if it does:
    the link goes on.

    Raises `InputError` if the file cannot be written, or by its name is none of these: a slip of
    the pen must not replace the mission.
    """

    def __init__(self, path: Path) -> None:
        check_ending(path, "--log", (".tlog",))
        check_writable(path)
        self.failure: str | None = None
        self._path = path
        self._file: FileIO | None = None

    def write(self, packet: bytes, *, received: bool) -> None:
        """Append `packet`, sent or received now."""
        begun = received or self._file is not None
        if self.failure is not None or not begun or message_id(packet) == _SETUP_SIGNING:
            return
        entry = struct.pack(">Q", int(time.time() * 1e6)) + packet
        try:
            if self._file is None:
                self._path.touch(mode=0o600)
                self._path.chmod(0o600)
                self._file = self._path.open("wb", buffering=0)
            while entry:
                entry = entry[self._file.write(entry) :]
        except OSError as error:
            self.failure = f"{self._path}: cannot be written: {error.strerror}; the log ends early"

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()


class WireLink:
    """One end of a link: runs talks and machines on a transport.

    What a machine answers goes where it was asked from. What it says by itself goes to everybody,
    and once the link is `bound` to a vehicle everything goes to that alone. `log` is the exchange
    in a file, if there is to be one; `note` is told what is odd, `observe` how far a talk is. Use
    the link in a `with` statement.
    """

    def __init__(
        self,
        connection: str | Transport,
        *,
        signing: Signing | None = None,
        log: Path | None = None,
        address: Address = protocol.GROUND_STATION,
        note: Callable[[str], object] = lambda _: None,
        observe: Observe = lambda *_: None,
    ) -> None:
        self.address, self._note, self._observe = address, note, observe
        self.codec = Codec(address, signing)
        self.log = None if log is None else Tlog(log)
        self._vehicle: tuple[Address, Origin] | None = None
        # A number in it tells it from that of another program with this address, if it comes back.
        of, token = (protocol.GROUND_STATION_TYPE, protocol.NO_AUTOPILOT), secrets.randbits(32)
        self._being_there = Heartbeat(*of, 0, token, protocol.MavState.ACTIVE)
        self.strangers: set[Origin] = set()
        """Where packets in the name of the vehicle come from that is bound elsewhere."""
        self._transport = open_transport(connection) if isinstance(connection, str) else connection
        self.listens = self._transport.listens
        """Whether anybody may send here: several vehicles, of one number perhaps."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the connection, finish the log."""
        self._transport.close()
        if self.log is not None:
            self.log.close()

    def bind(self, vehicle: Address, origin: Origin) -> None:
        """Talk to `vehicle` at `origin` alone from now on.

        What comes from elsewhere under its number is another vehicle's, or its own after its
        address has changed, which cannot be told apart: it is noted, and does not count. Nor do
        heartbeats from there that are not an autopilot's.
        """
        self._vehicle = vehicle, origin

    def run(self, talk: Talk[T]) -> T:
        """Run `talk` to its end and return the outcome.

        Interrupted from the keyboard it cancels the transfer first. Raises `LinkError`, which says
        what was under way.
        """
        machine = Script(talk)
        try:
            self.begin(machine)
            while (outcome := machine.outcome) is None:
                self.step(machine, time.monotonic() + _BEAT)
                self._observe(*machine.progress)
            return outcome
        except (KeyboardInterrupt, LinkError) as end:
            what, done, total = machine.progress
            text = f"while {what}" + (f" at item {done} of {total}" if total else "")
            if isinstance(end, LinkError):
                raise LinkError(f"{end}, {text}") from None
            self._send(machine.cancel(time.monotonic()))
            raise LinkError(f"interrupted {text}: cancelled") from None
        finally:
            talk.close()  # here, not whenever what is left of it is collected

    def watch(self, machine: Machine[T], observe: Callable[[], object], *, beats: bool) -> T:
        """Run `machine` to its end and return the outcome; `observe` is called after every step.

        With `beats` this end says once a second that it is a ground station. Interrupted from the
        keyboard the machine is told to cancel, and is run on until it ends; likewise `hang_up`
        when the terminal has gone, or `observe` cannot tell anybody anything any more.
        """
        heard, next_beat = True, time.monotonic()
        self.begin(machine)
        while (outcome := machine.outcome) is None:
            try:
                if time.monotonic() >= next_beat:
                    next_beat = time.monotonic() + _BEAT
                    self._send([self._being_there] * beats)
                self.step(machine, next_beat)
                try:
                    if heard:
                        observe()
                except OSError:
                    raise HangUp from None
            except HangUp:
                heard = False
                self._send(machine.hang_up(time.monotonic()))
            except KeyboardInterrupt:
                self._send(machine.cancel(time.monotonic()))
        return outcome

    def begin(self, machine: Machine[Any]) -> None:
        """Start `machine`; `step` then carries it on."""
        self._send(machine.start(time.monotonic()))

    def step(self, machine: Machine[Any], until: float) -> None:
        """Feed `machine` with what arrives first: packets, its deadline or the time `until`."""
        due = machine.deadline
        until = until if due is None else min(due, until)
        for data, origin in self._transport.read(until - time.monotonic()):
            for packet in self.codec.parse(data, origin):
                if not self._counts(packet, origin):
                    continue
                if self.log is not None:
                    self.log.write(packet.raw, received=True)
                if packet.envelope is not None:
                    self._send(machine.on(packet.envelope, time.monotonic()), origin)
        self._send(machine.tick(time.monotonic()))

    def _counts(self, packet: Packet, origin: Origin) -> bool:
        """Tell whether `packet` counts: no own heartbeat that comes back; for others see `bind`."""
        message = None if packet.envelope is None else packet.envelope.message
        if message == self._being_there:
            return False
        if self._vehicle is None or sender_of(packet.raw) != self._vehicle[0]:
            return True
        vehicle, own = self._vehicle
        if origin == own:
            return not isinstance(message, Heartbeat) or message.of_autopilot
        if origin not in self.strangers and len(self.strangers) < _SHOWN:
            self.strangers.add(origin)
            told = f"packets of {vehicle} come from {origin} too, not only from {own}"
            then = "they do not count. If the vehicle's address has changed, begin again"
            self._note(f"{told}: {then}")
        return False

    def _send(self, messages: Sequence[Message], to: Origin | None = None) -> None:
        for message in messages:
            packet = self.codec.pack(message)
            if self.log is not None:
                self.log.write(packet, received=False)
            self._transport.write(packet, to if self._vehicle is None else self._vehicle[1])
