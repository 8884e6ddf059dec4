"""A mock autopilot on a real link, which may be a bad one: what it does to packets, from a seed."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from operator import itemgetter
from random import Random

from faao_mav.sim.mock_autopilot import MockAutopilot
from faao_mav.wire.link import WireLink
from faao_mav.wire.signing import Signing
from faao_mav.wire.transport import Origin, Transport

_PATIENCE = 0.1  # Seconds between two looks at whether to stop serving.


@dataclass(frozen=True, slots=True)
class Faults:
    """What happens to packets, in each direction.

    `loss`, `duplication` and `corruption` are probabilities. Every packet takes `latency` seconds;
    with probability `reordering` it takes up to `delay` longer, so that later ones overtake it.
    A line of `rate` bytes per second (0: any) carries one packet after the other, lost ones too.
    Nothing passes during `outages` (from, to; seconds).
    """

    loss: float = 0.0
    duplication: float = 0.0
    corruption: float = 0.0
    reordering: float = 0.0
    delay: float = 0.0
    latency: float = 0.002
    rate: float = 0.0
    outages: tuple[tuple[float, float], ...] = ()
    seed: int = 0


class Channel:
    """One direction of a link; `name` sets its randomness apart from that of others."""

    def __init__(self, faults: Faults, name: str) -> None:
        self._faults, self._random = faults, Random(f"{faults.seed} {name}")
        self._free = 0.0

    def carry(self, packet: bytes, now: float) -> list[tuple[float, bytes]]:
        """Return when `packet`, sent at `now`, arrives, and as what; not at all, once or twice."""
        faults, random = self._faults, self._random
        if any(begin <= now < end for begin, end in faults.outages):
            return []
        if faults.rate:
            now = self._free = max(self._free, now) + len(packet) / faults.rate
        arrivals = []
        for _ in range(1 + (random.random() < faults.duplication)):
            if random.random() < faults.loss:
                continue
            late = random.random() < faults.reordering
            arrival = now + faults.latency + (random.uniform(0.0, faults.delay) if late else 0.0)
            content = bytearray(packet)
            if random.random() < faults.corruption:
                content[random.randrange(len(content))] ^= 1 << random.randrange(8)
            arrivals.append((arrival, bytes(content)))
        return arrivals


class FaultyTransport:
    """A transport that loses, repeats, delays and damages what passes it, both ways."""

    def __init__(self, inner: Transport, faults: Faults) -> None:
        self._inner, self.listens = inner, inner.listens
        self._in, self._out = Channel(faults, "in"), Channel(faults, "out")
        self._started = time.monotonic()
        self._under_way: list[tuple[float, bool, bytes, Origin | None]] = []
        """When it arrives, whether it goes out, the packet, and where from or to."""
        self._arrived: list[tuple[bytes, Origin]] = []

    def read(self, timeout: float) -> list[tuple[bytes, Origin]]:
        """Return what has arrived by now, or within `timeout` seconds."""
        self._pass(self._now())
        end = min([self._now() + timeout, *(each[0] for each in self._under_way[:1])])
        for data, origin in self._inner.read(0.0 if self._arrived else end - self._now()):
            self._push(self._in, data, origin)
        self._pass(self._now())
        arrived, self._arrived = self._arrived, []
        return arrived

    def write(self, data: bytes, to: Origin | None = None) -> None:
        """Send `data` as the faults allow: late, damaged, twice or not at all."""
        self._push(self._out, data, to)
        self._pass(self._now())

    def close(self) -> None:
        """Close the transport beneath; what was sent is under way, and arrives early."""
        try:
            self._pass(float("inf"))
        finally:
            self._inner.close()

    def _now(self) -> float:
        return time.monotonic() - self._started

    def _push(self, channel: Channel, data: bytes, where: Origin | None) -> None:
        for when, arriving in channel.carry(data, self._now()):
            self._under_way.append((when, channel is self._out, arriving, where))
        self._under_way.sort(key=itemgetter(0))

    def _pass(self, now: float) -> None:
        """Hand over what arrives by `now`."""
        while self._under_way and self._under_way[0][0] <= now:
            _, goes_out, data, where = self._under_way.pop(0)
            if goes_out:
                self._inner.write(data, where)
            else:
                self._arrived.append((data, where or ""))


def serve(
    mock: MockAutopilot,
    transport: Transport,
    *,
    faults: Faults | None = None,
    key: bytes | None = None,
    stop: Callable[[], bool] = lambda: False,
    observe: Callable[[MockAutopilot], object] = lambda _: None,
) -> None:
    """Run `mock` on `transport` until `stop()`; `observe` is shown it after every step."""
    if faults is not None:
        transport = FaultyTransport(transport, faults)
    signing = None if key is None else Signing(key)
    with WireLink(transport, signing=signing, address=mock.address) as link:
        link.begin(mock)
        while not stop():
            link.step(mock, time.monotonic() + _PATIENCE)
            observe(mock)
