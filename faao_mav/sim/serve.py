"""The mock autopilot on a real endpoint."""

import time
from collections.abc import Callable

from faao_mav.sim.faults import Faults, FaultyTransport
from faao_mav.sim.mock_autopilot import MockAutopilot
from faao_mav.wire.link import WireLink
from faao_mav.wire.signing import Signing
from faao_mav.wire.transport import Transport

_PATIENCE = 0.1
"""Seconds between two looks at whether to stop."""


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
