"""A mock autopilot in the background."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from faao_mav.sim import MockAutopilot
from faao_mav.sim.faults import Faults
from faao_mav.sim.serve import serve
from faao_mav.wire.transport import Transport, open_transport


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
