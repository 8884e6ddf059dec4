"""Who is on the link, and whether it is ready for a mission."""

from collections.abc import Sequence
from dataclasses import dataclass

from faao_mav.errors import LinkError
from faao_mav.mavlink.messages import CommandLong, Envelope, Heartbeat, HomePosition, Message
from faao_mav.mavlink.transfer.protocol import FIRMWARE_NAMES, Address, Autopilot, Firmware, State
from faao_mav.mission.item import Home
from faao_mav.plan.autopilots import Kind

_GCS = 6
_PLANES = frozenset({1, 19, 20, 21, 22, 23, 24, 25})  # fixed wing, VTOL
_HOME_POSITION, _REQUEST_MESSAGE = 242, 512


@dataclass(frozen=True, slots=True)
class FoundVehicle:
    """An autopilot that was heard."""

    address: Address
    firmware: Firmware
    kind: Kind
    armed: bool
    ready: bool

    def __str__(self) -> str:
        state = "armed" if self.armed else "disarmed" if self.ready else "booting"
        where = f"system {self.address.system}, component {self.address.component}"
        return f"{FIRMWARE_NAMES[self.firmware]} {self.kind} ({where}, {state})"


class Discovery:
    """A machine that listens for heartbeats; its outcome is the autopilots heard, by address.

    With `system` (and `component`) it waits until that one is ready, else until `settle` seconds
    after the first, to hear of others, and all are ready. It ends after `patience` without any,
    and after `boot` in any case.
    """

    progress = ("listening for a vehicle", 0, 0)

    def __init__(
        self,
        system: int | None = None,
        component: int | None = None,
        *,
        patience: float = 10.0,
        settle: float = 1.2,
        boot: float = 60.0,
    ) -> None:
        self.outcome: tuple[FoundVehicle, ...] | None = None
        self._system, self._component = system, component
        self._patience, self._settle, self._boot = patience, settle, boot
        self._found: dict[Address, FoundVehicle] = {}
        self._due = self._end = 0.0

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        return None if self.outcome is not None else self._due

    def start(self, now: float) -> Sequence[Message]:
        """Listen."""
        self._due, self._end = now + self._patience, now + self._boot
        return ()

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:
        """Take note of a heartbeat."""
        message, sender = envelope.message, envelope.sender
        if self.outcome is not None or not isinstance(message, Heartbeat):
            return ()
        if message.type == _GCS or message.autopilot == Autopilot.INVALID:
            return ()
        if self._system not in (None, sender.system):
            return ()
        if self._component not in (None, sender.component):
            return ()
        if not self._found:
            self._due = now + (self._settle if self._system is None else 0.0)
        self._found[sender] = _vehicle(sender, message)
        return self.tick(now)

    def tick(self, now: float) -> Sequence[Message]:
        """End when there is nothing more to wait for."""
        if self.outcome is None and now >= self._due:
            if all(found.ready for found in self._found.values()) or now >= self._end:
                self.outcome = tuple(self._found[address] for address in sorted(self._found))
            else:
                self._due = min(now + 0.2, self._end)
        return ()

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Stop listening."""
        self.outcome = self.outcome or ()
        return ()


class AskHome:
    """A machine that asks for HOME_POSITION; its outcome is a list with the home, or empty."""

    progress = ("asking for home", 0, 0)

    def __init__(self, vehicle: Address, wait: float = 1.0, retries: int = 2) -> None:
        self.outcome: list[Home] | None = None
        self._vehicle, self._wait, self._left = vehicle, wait, retries
        self._due = 0.0

    @property
    def deadline(self) -> float | None:
        """When `tick` is due."""
        return None if self.outcome is not None else self._due

    def start(self, now: float) -> Sequence[Message]:
        """Ask."""
        self._due = now + self._wait
        target = (self._vehicle.system, self._vehicle.component)
        return [CommandLong(*target, _REQUEST_MESSAGE, 0, float(_HOME_POSITION))]

    def on(self, envelope: Envelope, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Take the answer."""
        message = envelope.message
        if isinstance(message, HomePosition) and envelope.sender == self._vehicle:
            place = (message.latitude / 1e7, message.longitude / 1e7)
            self.outcome = [Home(*place, message.altitude / 1000)]
        return ()

    def tick(self, now: float) -> Sequence[Message]:
        """Ask again, or do without."""
        if self.outcome is not None or now < self._due:
            return ()
        if self._left == 0:
            self.outcome = []
            return ()
        self._left -= 1
        return self.start(now)

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Do without."""
        self.outcome = []
        return ()


def choose(
    found: Sequence[FoundVehicle],
    connection: str,
    system: int | None,
    component: int | None,
    patience: float,
) -> FoundVehicle:
    """Return the one vehicle that was `found`; raises `LinkError` if there is none, or several."""
    if not found:
        who = "an autopilot" if system is None else f"the autopilot of system {system}"
        who += "" if component is None else f" with component number {component}"
        raise LinkError(
            f"{connection}: no heartbeat of {who} within {patience:g} s; is it switched on and "
            "connected there, and no other program in between?"
        )
    if len(found) > 1:
        listed = "; ".join(map(str, found))
        raise LinkError(f"{connection}: several autopilots: {listed}. Choose one with --system")
    if not found[0].ready:
        raise LinkError(f"{connection}: {found[0]} does not finish booting")
    return found[0]


def _vehicle(sender: Address, heartbeat: Heartbeat) -> FoundVehicle:
    firmware: Firmware = "generic"
    if heartbeat.autopilot == Autopilot.ARDUPILOT:
        firmware = "ardupilot"
    elif heartbeat.autopilot == Autopilot.PX4:
        firmware = "px4"
    kind: Kind = "plane" if heartbeat.type in _PLANES else "copter"
    # UNINIT is what simple vehicles say that do not tell their state.
    ready = heartbeat.system_status not in (State.BOOT, State.CALIBRATING)
    return FoundVehicle(sender, firmware, kind, heartbeat.armed, ready)
