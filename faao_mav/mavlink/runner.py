"""The mock autopilot on a real endpoint."""

import heapq
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

from faao_mav.mavlink.faults import Channel, Faults
from faao_mav.mavlink.link import Link
from faao_mav.mavlink.mock import Fly, MockAutopilot
from faao_mav.mavlink.transport import Transport, open_transport
from faao_mav.mission.item import Mission
from faao_mav.vehicle import Track, Vehicle

_PATIENCE = 0.1  # s between two looks at whether to stop


class FaultyTransport:
    """A transport that loses, repeats, delays and damages what passes it, both ways.

    Over TCP and serial lines that is pieces of the stream, not packets.
    """

    def __init__(self, inner: Transport, faults: Faults) -> None:
        self._inner = inner
        self._channels = {way: Channel(faults, way) for way in ("in", "out")}
        self._queues: dict[str, list[tuple[float, int, bytes]]] = {"in": [], "out": []}
        self._order = count()
        self._started = time.monotonic()

    def read(self, timeout: float) -> list[bytes]:
        """Return what has arrived by now, or within `timeout` seconds."""
        self._flush()
        end = self._now() + timeout
        waiting = [queue[0][0] for queue in self._queues.values() if queue]
        for data in self._inner.read(min([end, *waiting]) - self._now()):
            self._push("in", data)
        self._flush()
        return self._due("in")

    def write(self, data: bytes) -> None:
        """Send `data`, perhaps, and perhaps later."""
        self._push("out", data)
        self._flush()

    def close(self) -> None:
        """Close the transport beneath; what is under way is lost."""
        self._inner.close()

    def _now(self) -> float:
        return time.monotonic() - self._started

    def _push(self, way: str, data: bytes) -> None:
        for when, arriving in self._channels[way].carry(data, self._now()):
            heapq.heappush(self._queues[way], (when, next(self._order), arriving))

    def _due(self, way: str) -> list[bytes]:
        queue, now, due = self._queues[way], self._now(), []
        while queue and queue[0][0] <= now:
            due.append(heapq.heappop(queue)[2])
        return due

    def _flush(self) -> None:
        for data in self._due("out"):
            self._inner.write(data)


def serve(
    mock: MockAutopilot,
    connection: str | Transport,
    *,
    faults: Faults | None = None,
    key: bytes | None = None,
    stop: Callable[[], bool] = lambda: False,
    observe: Callable[[MockAutopilot], object] | None = None,
) -> None:
    """Run `mock` at `connection` until `stop()`; `observe` is shown it after every step.

    Raises `LinkError` or `InputError` if the connection cannot be opened.
    """
    transport = open_transport(connection) if isinstance(connection, str) else connection
    if faults is not None:
        transport = FaultyTransport(transport, faults)
    with Link(transport, key=key, address=mock.address) as link:
        link.begin(mock)
        while not stop():
            link.step(mock, time.monotonic() + _PATIENCE)
            if observe is not None:
                observe(mock)


@contextmanager
def running(
    mock: MockAutopilot,
    connection: str | Transport,
    *,
    faults: Faults | None = None,
    key: bytes | None = None,
) -> Iterator[MockAutopilot]:
    """Run `mock` at `connection` in the background for as long as the `with` block lasts."""
    ended = threading.Event()
    transport = open_transport(connection) if isinstance(connection, str) else connection
    thread = threading.Thread(
        target=serve,
        args=(mock, transport),
        kwargs={"faults": faults, "key": key, "stop": ended.is_set},
        daemon=True,
    )
    thread.start()
    try:
        yield mock
    finally:
        ended.set()
        thread.join()


def predicted(vehicle: Vehicle) -> Fly:
    """Return how `vehicle` flies missions, by the flight prediction with its parameters."""

    def fly(mission: Mission) -> Track:
        from faao_mav.vehicle.predict import predict  # most uses of a mock never fly

        return predict(mission, vehicle)

    return fly
