"""Packets to and from a connection string: UDP, TCP, serial.

The strings are pymavlink's. The sockets are not: its connections print on standard output, hide
errors, and share UDP ports silently with whoever else listens.
"""

import contextlib
import errno
import select
import socket
import time
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeAlias

from faao_mav.errors import InputError, LinkError
from faao_mav.wire.codec import Framer

FORMS = (
    "udpin:HOST:PORT (listen), udpout:HOST:PORT (send), tcp:HOST:PORT (connect), "
    "tcpin:HOST:PORT (listen) or a serial port as DEVICE,BAUD"
)
_KINDS = ("udp", "udpin", "udpout", "tcp", "tcpin")
_CONNECT_TIMEOUT = 5.0  # Seconds to wait for a TCP connection. Chosen.

_WRITE_TIMEOUT = 5.0
"""Seconds in which a serial port has to take a packet: chosen, above the 4.3 s in which a line of
9600 baud empties the 4096 bytes that Linux keeps for it."""

_FORGET = 30.0
"""Seconds after which a silent UDP sender is not answered any more: chosen, 30 lost heartbeats."""

_MOST_PEERS = 64  # UDP senders that are remembered, and TCP peers, at most. Chosen: each gets all.
_BURST = 256  # Datagrams read at once: who sends without end stops nothing else. Chosen.

_REASONS = {
    errno.EADDRINUSE: "the port is in use; stop who listens there, or take another port",
    errno.EADDRNOTAVAIL: "this machine does not have that address; to listen on all, use 0.0.0.0",
    errno.EACCES: "not permitted; ports below 1024 are reserved",
}
"""Errors of a connection that this machine can not make: the argument is to be another one."""

_MAX_DATAGRAM, _DEFAULT_BAUD = 65_535, 57_600
"""Bytes; bits per second: what telemetry radios are delivered with."""

Origin: TypeAlias = str
"""Where packets come from: HOST:PORT, or "" on a line that has one other end."""


class Transport(Protocol):
    """Packets in, packets out; `listens`: anybody may send, from wherever."""

    listens: bool

    def read(self, timeout: float) -> list[tuple[bytes, Origin]]:
        """Return the packets that arrive within `timeout` seconds, as soon as something does."""

    def write(self, data: bytes, to: Origin | None = None, /) -> None:
        """Send one packet to `to`, or to everybody who was heard of late."""

    def close(self) -> None:
        """Let go of the connection."""


class Endpoint(NamedTuple):
    """A connection string, taken apart; `kind` "serial" has a device and a baud rate."""

    kind: str
    host: str
    port: int


def parse_connection(text: str) -> Endpoint:
    """Return what the connection string `text` says; raises `InputError`.

    >>> parse_connection("udp:0.0.0.0:14550")
    Endpoint(kind='udpin', host='0.0.0.0', port=14550)
    """
    kind, colon, rest = text.partition(":")
    if colon and kind in _KINDS:
        host, _, port = rest.rpartition(":")
        if not host or not port.isascii() or not port.isdigit():
            raise InputError(f"connection {text!r}: expected {kind}:HOST:PORT")
        if not 0 < int(port) < 65_536:
            raise InputError(f"connection {text!r}: port {port}; expected 1 to 65535")
        return Endpoint("udpin" if kind == "udp" else kind, host, int(port))
    device, comma, baud = text.partition(",")
    if not device or (colon and "/" not in kind) or not (comma or "/" in device):
        raise InputError(f"connection {text!r}: expected {FORMS}")
    if comma and not (baud.isascii() and baud.isdigit() and int(baud) > 0):
        raise InputError(f"connection {text!r}: baud rate {baud!r}; expected a number, as in 57600")
    return Endpoint("serial", device, int(baud) if comma else _DEFAULT_BAUD)


def open_transport(text: str) -> Transport:
    """Return a transport for the connection string `text`.

    Raises `InputError` for a string or device that is none, or where this machine cannot listen,
    `LinkError` if the other end cannot be reached.
    """
    kind, host, port = parse_connection(text)
    if kind == "serial":
        return _Serial(host, port)
    try:
        address = str(socket.getaddrinfo(host, port, socket.AF_INET)[0][4][0]), port
    except (OSError, UnicodeError):  # UnicodeError: empty or overlong labels between dots
        raise LinkError(f"connection {text!r}: there is no host {host}") from None
    try:
        of_kind = _Udp if kind.startswith("udp") else _Tcp
        return of_kind(address, listens=kind.endswith("in"))
    except OSError as error:
        if error.errno in _REASONS:
            raise InputError(f"connection {text!r}: {_REASONS[error.errno]}") from None
        reason = error.strerror or str(error)
        if isinstance(error, ConnectionRefusedError):
            reason = "nothing listens there"
        elif isinstance(error, TimeoutError):
            reason = f"no answer within {_CONNECT_TIMEOUT:g} s"
        raise LinkError(f"connection {text!r}: {reason}") from None


_Place: TypeAlias = tuple[str, int]
"""A host and a port."""


def _origin(address: _Place) -> Origin:
    return f"{address[0]}:{address[1]}"


class _Udp:
    """A UDP socket that sends to one place, or to whoever was heard."""

    def __init__(self, address: _Place, *, listens: bool) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._target, self.listens = None if listens else address, listens
        self._senders: dict[_Place, tuple[float, Framer]] = {}
        """When each was heard last, s, and what cuts it up; who is silent longest comes first."""
        self._socket.setblocking(False)
        if listens:
            try:
                self._socket.bind(address)
            except OSError:
                self._socket.close()
                raise

    def read(self, timeout: float) -> list[tuple[bytes, Origin]]:
        if not select.select([self._socket], [], [], max(timeout, 0.0))[0]:
            return []
        found: list[tuple[bytes, Origin]] = []
        # A refused datagram is told as an error of the next call: the other side is not up yet.
        with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
            for _ in range(_BURST):
                data, address = self._socket.recvfrom(_MAX_DATAGRAM)
                packets = self._framer(address).feed_datagram(data)
                found += [(packet, _origin(address)) for packet in packets]
        return found

    def write(self, data: bytes, to: Origin | None = None) -> None:
        recent = time.monotonic() - _FORGET
        targets = [place for place, (heard, _) in self._senders.items() if heard > recent]
        if self._target is not None:
            targets = [self._target]
        elif to is not None:
            host, _, port = to.rpartition(":")
            targets = [(host, int(port))]
        for target in targets:
            # Full buffers and absent receivers lose datagrams: that is what retries are for.
            with contextlib.suppress(OSError):
                self._socket.sendto(data, target)

    def close(self) -> None:
        self._socket.close()

    def _framer(self, address: _Place) -> Framer:
        """Return what cuts up what comes from `address`; too many forget who is silent longest."""
        _, framer = self._senders.pop(address, (0.0, Framer()))
        if len(self._senders) == _MOST_PEERS:
            del self._senders[next(iter(self._senders))]
        self._senders[address] = time.monotonic(), framer
        return framer


class _Tcp:
    """TCP: the connection that this end made, or all that others make to a listening socket."""

    def __init__(self, address: _Place, *, listens: bool) -> None:
        self._name, self.listens = f"tcp:{_origin(address)}", listens
        self._listener = socket.create_server(address) if listens else None
        self._peers: dict[socket.socket, tuple[Origin, Framer]] = {}
        if self._listener is not None:
            self._listener.setblocking(False)
        else:
            peer = socket.create_connection(address, timeout=_CONNECT_TIMEOUT)
            peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._peers[peer] = (_origin(address), Framer())

    def read(self, timeout: float) -> list[tuple[bytes, Origin]]:
        found: list[tuple[bytes, Origin]] = []
        for ready in select.select(self._sockets(), [], [], max(timeout, 0.0))[0]:
            if ready is self._listener:
                with contextlib.suppress(OSError):
                    self._welcome(*ready.accept())
                continue
            origin, framer = self._peers[ready]
            try:
                data = ready.recv(_MAX_DATAGRAM)
                if not data:
                    raise ConnectionError
                found += [(packet, origin) for packet in framer.feed(data)]
            except OSError as error:
                self._drop(ready, error)
        return found

    def write(self, data: bytes, to: Origin | None = None) -> None:
        for peer, (origin, _) in list(self._peers.items()):
            try:
                if to in (None, origin):
                    peer.sendall(data)
            except OSError as error:
                self._drop(peer, error)

    def close(self) -> None:
        for each in self._sockets():
            each.close()

    def _sockets(self) -> list[socket.socket]:
        return [*([self._listener] if self._listener else ()), *self._peers]

    def _welcome(self, peer: socket.socket, address: _Place) -> None:
        """Take one more peer, if there is room; it is dropped when it does not read."""
        if len(self._peers) == _MOST_PEERS:
            peer.close()
            return
        peer.setblocking(False)
        self._peers[peer] = (_origin(address), Framer())

    def _drop(self, peer: socket.socket, error: OSError) -> None:
        """Forget one of several peers; raise `LinkError` for the only one there can be."""
        del self._peers[peer]
        peer.close()
        if self._listener is None:
            closed = isinstance(error, ConnectionError)
            why = "the other side closed the connection" if closed else error.strerror or str(error)
            raise LinkError(f"{self._name}: {why}") from None


class _Serial:
    """A serial port."""

    listens = False

    def __init__(self, device: str, baud: int) -> None:
        import serial

        self._name, self._framer = device, Framer()
        self._late: type[Exception] = serial.SerialTimeoutException
        if "/" in device and not Path(device).exists():
            told = "there is no such device; is the vehicle plugged in?"
            raise InputError(f"connection {device!r}: {told}")
        try:
            self._port: Any = serial.Serial(device, baud, timeout=0, write_timeout=_WRITE_TIMEOUT)
        except (ValueError, OSError) as error:
            raise LinkError(f"connection {device!r}: {error}") from None

    def read(self, timeout: float) -> list[tuple[bytes, Origin]]:
        try:
            self._port.timeout = max(timeout, 0.0)
            data = bytes(self._port.read(1))
            data += bytes(self._port.read(self._port.in_waiting))
        except OSError as error:
            raise LinkError(f"{self._name}: {error}") from None
        return [(packet, "") for packet in self._framer.feed(data)]

    def write(self, data: bytes, _: Origin | None = None) -> None:
        try:
            self._port.write(data)
        except self._late:
            self._port.reset_output_buffer()  # closing waits for what is in it
            told = f"it has taken no bytes for {_WRITE_TIMEOUT:g} s"
            which = "is the vehicle switched on, and the cable or radio in order?"
            raise LinkError(f"{self._name}: {told}; {which}") from None
        except OSError as error:
            raise LinkError(f"{self._name}: {error}") from None

    def close(self) -> None:
        self._port.close()
