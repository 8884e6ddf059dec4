"""The gate of one flight while its vehicle is watched: what was read of it, and is heard now."""

from collections.abc import Sequence

from faao_mav.fly.preflight import preflight
from faao_mav.fly.seen import Flight, Held, read_held
from faao_mav.fly.telemetry import Telemetry
from faao_mav.validate.rule import Finding, Level
from faao_mav.wire.machine import Script
from faao_mav.wire.messages import Envelope, Message
from faao_mav.wire.transfer.exchange import Peer

_LOOK = 5.0
"""Seconds after which it is told what stands against a flight, though its place is not known.
Chosen."""


class Readiness:
    """The gate of `flight` by the vehicle of `peer`, of which `held` was read just before.

    For what is `allowed` see `preflight`. `findings` is what it found last, None before; `begun` is
    when the vehicle was first heard, s. `judge` looks now and then; before it is armed `settle`
    reads it again, while `on` is given what arrives.
    """

    def __init__(
        self,
        flight: Flight,
        held: Held,
        peer: Peer,
        **allowed: bool,
    ) -> None:
        self._flight, self._held, self._peer = flight, held, peer
        self._allowed = allowed
        self.findings: tuple[Finding, ...] | None = None
        self._judged: tuple[object, ...] = ()
        self._reading: Script[Held] | None = None
        self.begun = 0.0

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Those of `findings` for which nothing is armed."""
        return tuple(each for each in self.findings or () if each.level is Level.ERROR)

    @property
    def values(self) -> dict[str, float]:
        """The vehicle's parameters that a flight depends on, by name."""
        return self._held.reading.values

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Take note of what the vehicle says, and answer it."""
        return () if self._reading is None else self._reading.on(envelope, now)

    def judge(self, seen: Telemetry, now: float, *, again: bool = False) -> None:
        """Judge what is heard, once enough is, and `again` or when that is another state."""
        known = seen.place is not None and seen.status is not None
        if seen.heartbeat is None or not (known or now >= self.begun + _LOOK):
            return
        others = len(seen.stations), len(seen.strangers)
        state = seen.place is None, seen.armed, seen.custom_mode, seen.row, others
        if again or state != self._judged:
            self._judged = state
            self.findings = preflight(self._flight, self._held, seen, **self._allowed)

    def settle(self, seen: Telemetry, now: float) -> Sequence[Message] | None:
        """Return what is to be sent until the gate is up to date; None: `findings` is.

        What it holds is read again; without fresh news of the vehicle it waits.
        """
        if self._reading is None:
            self._reading = Script(read_held(self._peer))
            return self._reading.start(now)
        if self._reading.outcome is None:
            return self._reading.tick(now)
        if not seen.is_fresh(now):
            return ()
        self._held = self._reading.outcome
        self.judge(seen, now, again=True)
        return None

    def cancel(self, now: float) -> Sequence[Message]:
        """Read no more."""
        return () if self._reading is None else self._reading.cancel(now)
