"""Who is on the link, and ready for a mission."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from faao_mav.autopilot import (
    AutopilotFamily,
    VehicleType,
    families,
    kind_by_number,
    kinds,
    vehicle_type_by_numbers,
)
from faao_mav.errors import LinkError
from faao_mav.wire.machine import Machine
from faao_mav.wire.messages import Envelope, Heartbeat, Message, Timesync
from faao_mav.wire.protocol import (
    AUTOPILOT_COMPONENT,
    COMPANION_TYPE,
    GROUND_STATION_TYPE,
    NO_AUTOPILOT,
    Address,
    MavState,
)
from faao_mav.wire.transport import Origin

_SHOWN = 5
"""Vehicles that a message lists, at most; chosen."""

SETTLE = 1.2
"""Seconds after the first vehicle in which others are heard: chosen, above a heartbeat's period."""

_LOOK_AGAIN = 0.2
"""Seconds between two looks at whether all vehicles have booted: chosen, a fifth of a heartbeat's
period."""

_GREET = 1.0
"""Seconds between two questions to whoever is there: chosen, a heartbeat's period."""

_KNOCK = 2.0
"""Seconds of silence before a heartbeat is sent into it: chosen, two heartbeats of a vehicle."""

_KNOCKING = Heartbeat(COMPANION_TYPE, NO_AUTOPILOT, 0, 0, MavState.ACTIVE)
"""A heartbeat that counts nowhere: not a ground station's, and of another system."""


@dataclass(frozen=True, slots=True)
class FoundVehicle:
    """An autopilot that was heard; `vehicle` is None if it is not known here, or not of this type.

    `family` is its autopilot, None if that is not known; `kind` its type, "copter" or "plane", or
    its MAV_TYPE in words. It is `armed` if any of its heartbeats said so. `origins` are all places
    that packets in its name came from, the first one first.
    """

    address: Address
    vehicle: VehicleType | None
    family: AutopilotFamily | None
    kind: str
    armed: bool
    ready: bool
    origins: tuple[Origin, ...] = ("",)

    @property
    def autopilot(self) -> str:
        """The autopilot by its name in plans, or "generic"."""
        return "generic" if self.family is None else self.family.key

    def __str__(self) -> str:
        name = "an autopilot unknown here" if self.family is None else self.family.name
        state = "armed" if self.armed else "disarmed" if self.ready else "booting"
        return f"{name} {self.kind} ({self.address}, {state})"


class Discovery(Machine[tuple[FoundVehicle, ...]]):
    """A machine that listens for heartbeats; its outcome is the autopilots heard, by address.

    Only what flies counts, by its MAV_TYPE: not what else is on board or on the link. Of a system
    that is component 1, for which it waits as long as it has `patience`, and any other only
    without it. `system` and `component` leave out all others. `others` has what else was heard, in
    words.

    It ends `settle` seconds after the first, in which others are heard, once all are ready (at once
    where a `system` is given, unless told otherwise); after `patience` seconds without any; and
    after `boot` seconds in any case.

    Until there is one it asks whoever is there for the time (TIMESYNC): a vehicle that answers
    where it was spoken to has to be spoken to. With `knocks` it sends a heartbeat too where nothing
    at all is heard: PX4 1.13 and 1.14 say nothing on USB before they hear one.
    """

    progress = ("listening for a vehicle", 0, 0)

    def __init__(
        self,
        system: int | None = None,
        component: int | None = None,
        *,
        patience: float = 10.0,
        settle: float | None = None,
        boot: float = 60.0,
        knocks: bool = False,
    ) -> None:
        super().__init__()
        self._system, self._component = system, component
        usual = SETTLE if system is None else 0.0
        self._settle = usual if settle is None else settle
        self._patience, self._boot, self._knocks = patience, boot, knocks
        self._found: dict[Address, FoundVehicle] = {}
        self._origins: dict[Address, dict[Origin, None]] = {}
        self._begun = self._settled = 0.0
        self.others: dict[Address, str] = {}

    def start(self, now: float) -> Sequence[Message]:
        """Listen."""
        self._begun = now
        return self._greet(now)

    def _greet(self, now: float) -> Sequence[Message]:
        self._due = min(now + _GREET, self._begun + self._patience)
        knocks = self._knocks and now >= self._begun + _KNOCK
        return [Timesync(0, int(now * 1e9)), *([_KNOCKING] if knocks else [])]

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        message, sender = envelope.message, envelope.sender
        self._knocks = False
        self._origins.setdefault(sender, {})[envelope.origin] = None
        if not isinstance(message, Heartbeat) or message.type == GROUND_STATION_TYPE:
            return ()
        found = _found_vehicle(sender, message)
        chosen = Address(self._system or sender.system, self._component or sender.component)
        if sender != chosen or not message.of_autopilot:
            kind = str(found) if message.of_autopilot else f"MAV_TYPE {message.type} ({sender})"
            self.others[sender] = kind
            return ()
        if not self._found:
            self._due = self._settled = now + self._settle
        before = self._found.get(sender, found)
        self._found[sender] = replace(found, armed=found.armed or before.armed)
        return self.tick(now)

    def _time_out(self, now: float) -> Sequence[Message]:
        """End, if all that is waited for is there; else ask, or look again soon."""
        waited = now >= self._begun + self._patience
        if not (self._found or waited):
            return self._greet(now)
        mains = {address.system for address in self._found if _is_main(address)}
        found = tuple(
            replace(self._found[address], origins=tuple(self._origins[address]))
            for address in sorted(self._found)
            if _is_main(address) or address.system not in mains
        )
        complete = waited or self._component or all(_is_main(each.address) for each in found)
        ready = all(each.ready for each in found) or now >= self._begun + self._boot
        if now >= self._settled and complete and ready:
            self.outcome = found
        self._due = now + _LOOK_AGAIN
        return ()

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Stop listening."""
        self.outcome = self.outcome or ()
        return ()


def _is_main(address: Address) -> bool:
    return address.component == AUTOPILOT_COMPONENT


def choose(
    found: Sequence[FoundVehicle],
    connection: str,
    system: int | None,
    component: int | None,
    patience: float,
    others: Iterable[str] = (),
) -> FoundVehicle:
    """Return the one vehicle that was `found`; raises `LinkError` if there is none, or several.

    `others` is what else was heard, in words.
    """
    if not found:
        who = "an autopilot" if system is None else f"the autopilot of system {system}"
        who += "" if component is None else f" with component number {component}"
        heard = _listed(tuple(others))
        hint = "is it switched on and connected there, and no other program in between?"
        problem = f"no heartbeat of {who} within {patience:g} s; " + (
            f"there is only {heard}" if heard else hint
        )
    elif twins := [each for each in found if len(each.origins) > 1]:
        origins = " and ".join(twins[0].origins[:_SHOWN])
        problem = (
            f"{twins[0].address} is heard from {origins}: more than one vehicle has this number, "
            "and which is meant is not known. Give each its own, or connect to one alone"
        )
    elif len(found) > 1:
        option = "component" if len({each.address.system for each in found}) == 1 else "system"
        names = _listed(tuple(map(str, found)))
        problem = f"several autopilots: {names}. Choose one with --{option}"
    elif not found[0].ready:
        problem = f"{found[0]} does not finish booting"
    elif found[0].family is not None and found[0].vehicle is None:
        known = f"{' and '.join(kinds())} are (VTOLs are neither)"
        problem = f"{found[0]}: this type of vehicle is not supported; {known}"
    else:
        return found[0]
    raise LinkError(f"{connection}: {problem}")


def _listed(names: Sequence[str]) -> str:
    more = f"; and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return "; ".join(names[:_SHOWN]) + more


def _found_vehicle(sender: Address, heartbeat: Heartbeat) -> FoundVehicle:
    vehicle = vehicle_type_by_numbers(heartbeat.autopilot, heartbeat.type)
    family = next((f for f in families() if f.mav_autopilot == heartbeat.autopilot), None)
    kind = kind_by_number(heartbeat.type) or f"vehicle of MAV_TYPE {heartbeat.type}"
    # UNINIT is what simple vehicles say that do not tell their state.
    ready = heartbeat.system_status not in (MavState.BOOT, MavState.CALIBRATING)
    return FoundVehicle(sender, vehicle, family, kind, heartbeat.armed, ready)
