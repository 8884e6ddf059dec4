"""Who is on the link, and ready for a mission."""

from dataclasses import dataclass, replace

from faao_mav import autopilot
from faao_mav.errors import LinkError
from faao_mav.wire import protocol
from faao_mav.wire.machine import AT_ONCE, Talk
from faao_mav.wire.messages import Heartbeat, Timesync
from faao_mav.wire.protocol import Address, MavState, listed
from faao_mav.wire.transport import Origin

_MAIN = 1  # MAV_COMP_ID_AUTOPILOT1: by custom the autopilot's number in its system.
_BOOT = 60.0  # Seconds that a vehicle may boot. Chosen.

_SETTLE, _GREET, _KNOCK = 1.2, 1.0, 2.0
"""Seconds after the first vehicle in which others are heard; between two questions to whoever is
there; and of silence before a heartbeat is sent into it. Chosen: vehicles send one each second."""

_NOTHING = "is it switched on and connected there, and no other program in between?"

_KNOCKING = Heartbeat(protocol.COMPANION_TYPE, protocol.NO_AUTOPILOT, 0, 0, MavState.ACTIVE)
"""A heartbeat that counts nowhere: not a ground station's, and of another system."""


@dataclass(frozen=True, slots=True)
class FoundVehicle:
    """An autopilot that was heard; `vehicle` is None if it is not known here, or not of this type.

    `family` is its autopilot, None if that is not known; `kind` its type, "copter" or "plane", or
    its MAV_TYPE in words. It is `armed` if any of its heartbeats said so. `origins` are all places
    that packets in its name came from, the first one first.
    """

    address: Address
    vehicle: autopilot.VehicleType | None
    family: autopilot.AutopilotFamily | None
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


@dataclass(frozen=True, slots=True)
class Heard:
    """The autopilots that were heard, by address, and in words what else was."""

    vehicles: tuple[FoundVehicle, ...]
    others: tuple[str, ...] = ()


def discover(
    system: int | None = None,
    component: int | None = None,
    *,
    patience: float = 10.0,
    listens: bool = False,
    knocks: bool = False,
) -> Talk[Heard]:
    """Listen for heartbeats.

    Only what flies counts, by its MAV_TYPE: not what else is on board or on the link. Of a system
    that is component 1, or the `component` that is given. `system` leaves out all others.

    It ends `_SETTLE` seconds after the first, in which others are heard, once all are ready; at
    once where a `system` is given, unless the link `listens` to whoever calls; after `patience`
    seconds without any, and after `_BOOT` seconds in any case.

    Until there is one it asks whoever is there for the time (TIMESYNC): a vehicle that answers
    where it was spoken to has to be spoken to. With `knocks` it sends a heartbeat too where nothing
    at all is heard: PX4 1.13 and 1.14 say nothing on USB before they hear one.
    """
    line = yield AT_ONCE
    line.progress = "listening for a vehicle", 0, 0
    begun = greet = settled = line.now
    found, others = dict[Address, FoundVehicle](), dict[Address, str]()
    origins = dict[Address, dict[Origin, None]]()
    while True:
        if line.heard is not None:
            knocks, sender, message = False, line.heard.sender, line.heard.message
            origins.setdefault(sender, {})[line.heard.origin] = None
            if isinstance(message, Heartbeat) and message.type != protocol.GROUND_STATION_TYPE:
                vehicle = _found_vehicle(sender, message)
                meant = system in (None, sender.system) and sender.component == (component or _MAIN)
                if not message.of_autopilot:
                    others[sender] = f"MAV_TYPE {message.type} ({sender})"
                elif not meant:
                    others[sender] = str(vehicle)
                else:
                    if not found:
                        settled = line.now + _SETTLE * (system is None or listens)
                    armed = vehicle.armed or (sender in found and found[sender].armed)
                    found[sender] = replace(vehicle, armed=armed)
        booting = any(not each.ready for each in found.values()) and line.now < begun + _BOOT
        until = max(settled, begun + _BOOT if booting else 0.0) if found else begun + patience
        if line.now >= until:
            break
        if not found and line.now >= greet:
            late = knocks and line.now >= begun + _KNOCK
            line.say(Timesync(0, int(line.now * 1e9)), *[_KNOCKING] * late)
            greet = line.now + _GREET
        line = yield until if found else min(greet, until)
    vehicles = (replace(found[each], origins=tuple(origins[each])) for each in sorted(found))
    return Heard(tuple(vehicles), tuple(others.values()))


def choose(
    heard: Heard, connection: str, system: int | None, component: int | None, patience: float
) -> FoundVehicle:
    """Return the one vehicle that was `heard`; raises `LinkError` if there is none, or several."""
    found = heard.vehicles
    if not found:
        who = "an autopilot" if system is None else f"the autopilot of system {system}"
        who += "" if component is None else f" with component number {component}"
        others = f"there is only {listed(heard.others)}" if heard.others else _NOTHING
        problem = f"no heartbeat of {who} within {patience:g} s; {others}"
    elif twins := [each for each in found if len(each.origins) > 1]:
        origins = " and ".join(twins[0].origins[:2])
        more = "more than one vehicle has this number, and which is meant is not known"
        problem = f"{twins[0].address} is heard from {origins}: {more}. Give each its own, or "
        problem += "connect to one alone"
    elif len(found) > 1:
        problem = f"several autopilots: {listed([*map(str, found)])}. Choose one with --system"
    elif not found[0].ready:
        problem = f"{found[0]} does not finish booting"
    elif found[0].family is not None and found[0].vehicle is None:
        known = f"{' and '.join(autopilot.kinds())} are (VTOLs are neither)"
        problem = f"{found[0]}: this type of vehicle is not supported; {known}"
    else:
        return found[0]
    raise LinkError(f"{connection}: {problem}")


def _found_vehicle(sender: Address, heartbeat: Heartbeat) -> FoundVehicle:
    vehicle = autopilot.vehicle_type_by_numbers(heartbeat.autopilot, heartbeat.type)
    families = autopilot.families().values()
    family = next((each for each in families if each.mav_autopilot == heartbeat.autopilot), None)
    kind = autopilot.kind_by_number(heartbeat.type) or f"vehicle of MAV_TYPE {heartbeat.type}"
    # MAV_STATE_UNINIT is what simple vehicles say that do not tell their state.
    ready = heartbeat.system_status not in (MavState.BOOT, MavState.CALIBRATING)
    return FoundVehicle(sender, vehicle, family, kind, heartbeat.armed, ready)
