"""A bad link: what it does to packets, from a seed."""

import heapq
import time
from dataclasses import dataclass, field
from itertools import count
from random import Random

from faao_mav.wire.framing import message_id
from faao_mav.wire.transport import Origin, Transport


@dataclass(frozen=True, slots=True)
class Lost:
    """One particular packet that does not arrive: the `number`-th (from 1) with `message_id`."""

    message_id: int
    number: int = 1


@dataclass(frozen=True, slots=True)
class Faults:
    """What happens to packets, in each direction.

    `loss`, `duplication` and `corruption` are probabilities. Every packet takes `latency` seconds;
    with probability `reordering` it takes up to `delay` longer, so that later ones overtake it.
    A line of `rate` bytes per second (0: any) carries one packet after the other, lost ones too.
    Nothing passes during `outages` (from, to; seconds). `lost` names packets one by one.
    """

    loss: float = 0.0
    duplication: float = 0.0
    corruption: float = 0.0
    reordering: float = 0.0
    delay: float = 0.0
    latency: float = 0.002
    rate: float = 0.0
    outages: tuple[tuple[float, float], ...] = ()
    lost: tuple[Lost, ...] = ()
    seed: int = 0


@dataclass(slots=True)
class Channel:
    """One direction of a link; `name` sets its randomness apart from that of others."""

    faults: Faults
    name: str
    _random: Random = field(init=False)
    _seen: dict[int, int] = field(init=False)
    _free: float = field(init=False)

    def __post_init__(self) -> None:
        self._random = Random(f"{self.faults.seed} {self.name}")
        self._seen = {}
        self._free = 0.0

    def carry(self, packet: bytes, now: float) -> list[tuple[float, bytes]]:
        """Return when `packet`, sent at `now`, arrives, and as what; not at all, once or twice."""
        faults, random = self.faults, self._random
        if self._is_lost(packet) or any(begin <= now < end for begin, end in faults.outages):
            return []
        sent = self._sent(packet, now)
        copies = 1 + (random.random() < faults.duplication)
        arrivals = []
        for _ in range(copies):
            if random.random() < faults.loss:
                continue
            late = random.random() < faults.reordering
            arrival = sent + faults.latency + (random.uniform(0.0, faults.delay) if late else 0.0)
            damaged = random.random() < faults.corruption
            arrivals.append((arrival, self._damaged(packet) if damaged else packet))
        return arrivals

    def _sent(self, packet: bytes, now: float) -> float:
        """Return when the last byte of `packet` has gone into the line."""
        if not self.faults.rate:
            return now
        self._free = max(self._free, now) + len(packet) / self.faults.rate
        return self._free

    def _is_lost(self, packet: bytes) -> bool:
        if not self.faults.lost:
            return False
        number = message_id(packet)
        self._seen[number] = self._seen.get(number, 0) + 1
        return Lost(number, self._seen[number]) in self.faults.lost

    def _damaged(self, packet: bytes) -> bytes:
        content = bytearray(packet)
        place = self._random.randrange(len(content))
        content[place] ^= 1 << self._random.randrange(8)
        return bytes(content)


class FaultyTransport:
    """A transport that loses, repeats, delays and damages what passes it, both ways."""

    def __init__(self, inner: Transport, faults: Faults) -> None:
        self._inner = inner
        self.listens = inner.listens
        self._channels = {way: Channel(faults, way) for way in ("in", "out")}
        self._queues: dict[str, list[tuple[float, int, bytes, Origin | None]]] = {
            "in": [],
            "out": [],
        }
        self._order = count()
        self._started = time.monotonic()

    def read(self, timeout: float) -> list[tuple[bytes, Origin]]:
        """Return what has arrived by now, or within `timeout` seconds."""
        self._flush()
        end = self._now() + timeout
        waiting = [queue[0][0] for queue in self._queues.values() if queue]
        for data, origin in self._inner.read(min([end, *waiting]) - self._now()):
            self._push("in", data, origin)
        self._flush()
        return [(data, origin or "") for data, origin in self._due("in")]

    def write(self, data: bytes, to: Origin | None = None) -> None:
        """Send `data` as the faults allow: late, damaged, twice or not at all."""
        self._push("out", data, to)
        self._flush()

    def close(self) -> None:
        """Close the transport beneath; what was sent is under way, and arrives early."""
        try:
            for _, _, data, to in sorted(self._queues["out"]):
                self._inner.write(data, to)
        finally:
            self._inner.close()

    def _now(self) -> float:
        return time.monotonic() - self._started

    def _push(self, way: str, data: bytes, where: Origin | None) -> None:
        for when, arriving in self._channels[way].carry(data, self._now()):
            heapq.heappush(self._queues[way], (when, next(self._order), arriving, where))

    def _due(self, way: str) -> list[tuple[bytes, Origin | None]]:
        queue, now, due = self._queues[way], self._now(), []
        while queue and queue[0][0] <= now:
            due.append(heapq.heappop(queue)[2:])
        return due

    def _flush(self) -> None:
        for data, to in self._due("out"):
            self._inner.write(data, to)
