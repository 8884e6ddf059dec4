"""Who is on the link, whether it is there now and ready for a mission, and where its home is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from faao_mav.errors import LinkError
from faao_mav.mavlink.machine import AskingMachine, Machine
from faao_mav.mavlink.messages import (
    CommandLong,
    Envelope,
    Heartbeat,
    HomePosition,
    Message,
    Timesync,
)
from faao_mav.mavlink.protocol import (
    GROUND_STATION_TYPE,
    HOME_POSITION,
    NO_AUTOPILOT,
    Address,
    MavCommand,
    MavState,
)
from faao_mav.mission.item import Home
from faao_mav.plan.autopilots import types
from faao_mav.vehicle import (
    AutopilotFamily,
    VehicleType,
    families,
    kind_by_number,
    vehicle_type_by_numbers,
)

_SHOWN = 5
"""Vehicles that a message lists, at most; chosen."""

_LOOK_AGAIN = 0.2
"""Seconds between two looks at whether all vehicles have booted: chosen, a fifth of a heartbeat's
period."""


@dataclass(frozen=True, slots=True)
class FoundVehicle:
    """An autopilot that was heard; `vehicle` is None if it is not known here, or not of this type.

    `family` is its autopilot, None if that is not known; `kind` its type, "copter" or "plane", or
    its MAV_TYPE in words. It is `armed` if any heartbeat of its system said so.
    """

    address: Address
    vehicle: VehicleType | None
    family: AutopilotFamily | None
    kind: str
    armed: bool
    ready: bool

    @property
    def autopilot(self) -> str:
        """The autopilot by its name in plans, or "generic"."""
        return "generic" if self.family is None else self.family.key

    def __str__(self) -> str:
        name = "an autopilot unknown here" if self.family is None else self.family.name
        state = "armed" if self.armed else "disarmed" if self.ready else "booting"
        where = f"system {self.address.system}, component {self.address.component}"
        return f"{name} {self.kind} ({where}, {state})"


class Discovery(Machine[tuple[FoundVehicle, ...]]):
    """A machine that listens for heartbeats; its outcome is the autopilots heard, by address.

    With `system` (and `component`) it waits until that one is ready, else until `settle` seconds
    after the first, to hear of others, and all are ready. It ends after `patience` seconds without
    any, and after `boot` seconds in any case.
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
        super().__init__()
        self._system, self._component = system, component
        self._patience, self._settle, self._boot = patience, settle, boot
        self._found: dict[Address, FoundVehicle] = {}
        self._armed: set[int] = set()
        self._end = 0.0

    def start(self, now: float) -> Sequence[Message]:
        """Listen."""
        self._due, self._end = now + self._patience, now + self._boot
        return ()

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        message, sender = envelope.message, envelope.sender
        if not isinstance(message, Heartbeat) or message.type == GROUND_STATION_TYPE:
            return ()
        if message.armed:
            self._armed.add(sender.system)
        if message.autopilot == NO_AUTOPILOT or self._system not in (None, sender.system):
            return ()
        if self._component not in (None, sender.component):
            return ()
        if not self._found:
            self._due = now + (self._settle if self._system is None else 0.0)
        self._found[sender] = _found_vehicle(sender, message)
        return self.tick(now)

    def _time_out(self, now: float) -> Sequence[Message]:
        if all(found.ready for found in self._found.values()) or now >= self._end:
            found = (self._found[address] for address in sorted(self._found))
            self.outcome = tuple(
                replace(each, armed=each.address.system in self._armed) for each in found
            )
        else:
            self._due = min(now + _LOOK_AGAIN, self._end)
        return ()

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Stop listening."""
        self.outcome = self.outcome or ()
        return ()


class AskHome(AskingMachine[list[Home]]):
    """A machine that asks for HOME_POSITION; its outcome is a list with the home, or empty."""

    progress = ("asking for home", 0, 0)

    def __init__(self, vehicle: Address, wait: float = 1.0, retries: int = 2) -> None:
        super().__init__(wait, retries)
        self._vehicle = vehicle

    def _question(self) -> Message:
        return CommandLong(self._vehicle, MavCommand.REQUEST_MESSAGE, 0, float(HOME_POSITION))

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:  # noqa: ARG002
        message = envelope.message
        if isinstance(message, HomePosition) and envelope.sender == self._vehicle:
            place = (message.latitude / 1e7, message.longitude / 1e7)
            self.outcome = [Home(*place, message.altitude / 1000)]
        return ()

    def _give_up(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        self.outcome = []
        return ()

    def cancel(self, now: float) -> Sequence[Message]:
        """Do without."""
        return self._give_up(now)


class AskAlive(AskingMachine[bool]):
    """A machine that asks for the answer to a `number` that nobody could know before.

    It asks twice a second for `patience` seconds. Its outcome is whether `vehicle` answered: on a
    link that is signed a recording cannot, and what was recorded before the answer is older than
    it, so that it is passed over from then on.

    >>> vehicle = Address(1, 1)
    >>> asking = AskAlive(vehicle, number=77)
    >>> asking.start(now=0.0)
    [Timesync(tc1=0, ts1=77)]
    >>> asking.on(Envelope(vehicle, Timesync(123_456, 77)), now=0.1)
    ()
    >>> asking.outcome
    True
    """

    progress = ("asking for a sign of life", 0, 0)

    def __init__(self, vehicle: Address, number: int, patience: float = 9.0) -> None:
        super().__init__(0.5, math.ceil(patience / 0.5) - 1)
        self._vehicle, self._number = vehicle, number

    def _question(self) -> Message:
        return Timesync(0, self._number)

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:  # noqa: ARG002
        message = envelope.message
        if isinstance(message, Timesync) and envelope.sender == self._vehicle:
            self.outcome = (message.tc1 != 0 and message.ts1 == self._number) or None
        return ()

    def _give_up(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        self.outcome = False
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
        listed = "; ".join(map(str, found[:_SHOWN]))
        more = f"; and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
        raise LinkError(
            f"{connection}: several autopilots: {listed}{more}. Choose one with --system"
        )
    if not found[0].ready:
        raise LinkError(f"{connection}: {found[0]} does not finish booting")
    if found[0].family is not None and found[0].vehicle is None:
        raise LinkError(
            f"{connection}: {found[0]}: this type of vehicle is not supported; "
            f"{' and '.join(types())} are (VTOLs are neither)"
        )
    return found[0]


def _found_vehicle(sender: Address, heartbeat: Heartbeat) -> FoundVehicle:
    vehicle = vehicle_type_by_numbers(heartbeat.autopilot, heartbeat.type)
    family = next((f for f in families() if f.mav_autopilot == heartbeat.autopilot), None)
    kind = kind_by_number(heartbeat.type) or f"vehicle of MAV_TYPE {heartbeat.type}"
    # UNINIT is what simple vehicles say that do not tell their state.
    ready = heartbeat.system_status not in (MavState.BOOT, MavState.CALIBRATING)
    return FoundVehicle(sender, vehicle, family, kind, heartbeat.armed, ready)
