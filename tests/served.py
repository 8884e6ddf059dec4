"""A mock autopilot in the background."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from conftest import free_port

from faao_mav.mission.item import Home
from faao_mav.sim import MockAutopilot, MockKind, behaviour_of
from faao_mav.sim.faults import Faults, serve
from faao_mav.wire.transport import Transport, open_transport

HOME = Home(-35.363262, 149.165237, 584.0)
"""Where the plans of the tests count from."""


@contextmanager
def vehicle(
    kind: MockKind = "ardupilot",
    make: type[MockAutopilot] = MockAutopilot,
    *,
    refusals: Any = (),
    faults: Faults | None = None,
    key: bytes | None = None,
    **options: Any,
) -> Iterator[tuple[str, Any]]:
    """A mock at `HOME` that runs in the background, and the connection to it."""
    behaviour, port = behaviour_of(kind, refusals=dict(refusals)), free_port()
    mock = make(behaviour, **{"home": HOME, "beat": 0.1, **options})
    with running(mock, f"udpin:127.0.0.1:{port}", faults=faults, key=key):
        yield f"udpout:127.0.0.1:{port}", mock


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
