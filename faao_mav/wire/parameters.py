"""Reading and setting a vehicle's parameters by their names.

Source: MAVLink developer guide, "Parameter Protocol". ArduPilot sends whole numbers as numbers,
PX4 as their bits (its "byte-wise encoding").
"""

import math
import struct
from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from faao_mav.autopilot import VehicleType, vehicle_types
from faao_mav.autopilot.parameter import Parameter
from faao_mav.errors import InputError
from faao_mav.wire.machine import Ask, Machine, Progress
from faao_mav.wire.messages import Envelope, Message, ParamRequestRead, ParamSet, ParamValue
from faao_mav.wire.transfer.exchange import Peer
from faao_mav.wire.transfer.pace import Pace, Questions

Names: TypeAlias = tuple[str, ...]
"""The names that one parameter has in the generations of an autopilot: a vehicle has one."""

_INT32 = 6
"""MAV_PARAM_TYPE of whole numbers of 32 bits."""

_AT_ONCE = 10
"""Names that are asked for at once. Chosen: half of the queue that ArduPilot has for them."""

_SHOWN = 5
"""Names that a message lists, at most; chosen."""

_LEAST_WAIT, _TRIES = 0.25, 8
"""Seconds after which a name is asked for again at the earliest, and how often it is asked for.
Chosen: of 50 parameters, over a link that loses a fifth each way, one stays unread in 1.4 % of all
readings; a name that the vehicle does not know costs 4 s."""


@dataclass(frozen=True, slots=True)
class Setting:
    """The value of a parameter, and its MAV_PARAM_TYPE."""

    value: float
    kind: int


@dataclass(frozen=True, slots=True)
class Reading:
    """What was read: `settings` by name; of `missing` no name was answered."""

    settings: Mapping[str, Setting]
    missing: tuple[Names, ...] = ()

    @property
    def values(self) -> dict[str, float]:
        """The values by name."""
        return {name: setting.value for name, setting in self.settings.items()}


def setting_in(message: ParamValue, vehicle: VehicleType | None) -> Setting:
    """Return what `message` of `vehicle` says, in whose manner whole numbers are sent."""
    value, kind = message.param_value, message.param_type
    if vehicle is not None and vehicle.family.whole_as_bits and kind == _INT32:
        (value,) = struct.unpack("<i", struct.pack("<f", value))
    return Setting(value, kind)


def on_the_wire(setting: Setting, vehicle: VehicleType | None) -> float:
    """Return the number that carries `setting` to `vehicle`: the reverse of `setting_in`."""
    if vehicle is not None and vehicle.family.whole_as_bits and setting.kind == _INT32:
        whole = min(max(round(setting.value), -(2**31)), 2**31 - 1)
        (bits,) = struct.unpack("<f", struct.pack("<i", whole))
        return float(bits)
    return setting.value


def same_value(one: float, other: float) -> bool:
    """Tell whether two numbers are one in the single precision of the wire.

    >>> same_value(0.1, 0.10000000149), same_value(0.1, 0.1001)
    (True, False)
    """
    return struct.pack("<f", one) == struct.pack("<f", other)


def close(one: float, other: float) -> bool:
    """Tell whether two numbers, one of them converted from another unit, are one on the wire."""
    return same_value(one, other) or math.isclose(one, other, rel_tol=1e-6)


class ReadParameters(Machine[Reading]):
    """A machine that reads `parameters` of the vehicle of `peer`, each by all of its names.

    A name is asked for `_TRIES` times in the pace of the link; who answers none of the first ones
    has no parameters.
    """

    def __init__(self, peer: Peer, parameters: Sequence[Names]) -> None:
        super().__init__()
        self._peer = peer
        self._all = tuple(dict.fromkeys(parameters))
        self._left = list(self._all)
        self._asked = Questions[Names](Pace(peer.timeouts))
        self._asked.least = _LEAST_WAIT
        self._settings: dict[str, Setting] = {}
        self._missing: list[Names] = []

    @property
    def progress(self) -> Progress:
        """Parameters that are done with, of all."""
        done = len(self._all) - len(self._left) - len(self._asked)
        return "reading parameters", done, len(self._all)

    def start(self, now: float) -> Sequence[Message]:
        """Ask for the first ones."""
        return self._proceed(now)

    def _receive(self, envelope: Envelope, now: float) -> Sequence[Message]:
        message = envelope.message
        if envelope.sender != self._peer.address or not isinstance(message, ParamValue):
            return ()
        names = next((each for each in self._asked if message.param_id in each), None)
        if names is None:
            return ()
        self._settings[message.param_id] = setting_in(message, self._peer.vehicle)
        self._asked.answer(names, now)
        return self._proceed(now)

    def _time_out(self, now: float) -> Sequence[Message]:
        out: list[Message] = []
        for names in self._asked.late(now):
            if self._asked.times(names) > _TRIES:
                self._missing.append(names)
                self._asked.answer(names, now)
            else:
                out += self._questions(names)
        if not self._settings and self._missing:
            return self.cancel(now)
        return [*out, *self._proceed(now)]

    def cancel(self, now: float) -> Sequence[Message]:  # noqa: ARG002
        """Do without those that are not read yet."""
        self.outcome = Reading(self._settings, (*self._missing, *self._asked, *self._left))
        return ()

    def _proceed(self, now: float) -> Sequence[Message]:
        out: list[Message] = []
        while self._left and sum(map(len, self._asked)) < _AT_ONCE:
            names = self._left.pop(0)
            self._asked.put(names, now)
            out += self._questions(names)
        if not self._asked:
            return self.cancel(now)
        self._due = self._asked.due
        return out

    def _questions(self, names: Names) -> list[Message]:
        return [ParamRequestRead(self._peer.address, name, -1) for name in names]


def set_parameter(peer: Peer, name: str, setting: Setting) -> Ask[bool]:
    """Return a machine that sets the parameter `name` of the vehicle of `peer` to `setting`.

    It tells the value until the vehicle answers with it: setting it twice does no harm.
    """

    def answer(envelope: Envelope) -> bool | None:
        message = envelope.message
        if envelope.sender != peer.address or not isinstance(message, ParamValue):
            return None
        found = setting_in(message, peer.vehicle)
        return (message.param_id == name and same_value(found.value, setting.value)) or None

    number = on_the_wire(setting, peer.vehicle)
    question = ParamSet(peer.address, name, number, setting.kind)
    return Ask(f"setting {name}", question, answer, peer.timeouts.silence)


@dataclass(frozen=True, slots=True)
class Change:
    """A parameter that was to become `wanted`, was `old`, and is `new`: None if that is unread."""

    name: str
    old: float
    wanted: float
    new: float | None

    @property
    def made(self) -> bool:
        """Whether it has the value that was wanted."""
        return self.new is not None and same_value(self.new, self.wanted)

    def __str__(self) -> str:
        now = "not read back" if self.new is None else f"{self.new:g}"
        asked = "" if self.made else f" (asked for {self.wanted:g})"
        return f"{self.name} {self.old:g} -> {now}{asked}"


def number_in(parameter: Parameter, name: str, given: Mapping[str, float]) -> float | None:
    """Return what `given` says of `parameter`, as the number under its `name`; None: nothing.

    >>> speed = Parameter("cruise_speed", "m/s", 10.0, {"WP_SPD": 1.0, "WPNAV_SPEED": 0.01})
    >>> number_in(speed, "WP_SPD", {"WPNAV_SPEED": 750.0})
    7.5
    """
    if name in given:
        return given[name]
    other = parameter.name_in(given)
    if other is None:
        return None
    return parameter.written(parameter.names[other] * given[other], name)


def check_settable(parameters: Iterable[str], source: object) -> None:
    """Raise `InputError`, which names `source`, for a parameter that is not a mission's own.

    Those are what shapes how some vehicle flies a mission; what decides about failsafes, fence,
    return and checks is for its pilot to set.
    """
    tables = (each.parameters.values() for each in vehicle_types())
    own = {name for table in tables for each in table if each.motion for name in each.names}
    other = [name for name in parameters if name not in own]
    if other:
        raise InputError(
            f"{source}: {named(other)}: not among what a mission is timed for, which alone is set "
            "with it; set it with the ground station, and give the mission's own file"
        )


def named(names: Sequence[str]) -> str:
    """Return the first of some names in a line, and how many more there are."""
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more


def set_parameters(
    wanted: Mapping[str, float], peer: Peer
) -> Generator[Machine[Any], Any, tuple[tuple[Change, ...], str]]:
    """Give the vehicle of `peer` the parameters of its table that `wanted` names, and read them.

    Of the names of one parameter it sets the one that the vehicle has. Nothing is set if the
    vehicle does not know one; it stops at the first that the vehicle does not take. Return the
    changes, and in words what went wrong, "" for nothing.
    """
    table = () if peer.vehicle is None else peer.vehicle.parameters.values()
    groups = {tuple(each.names): each for each in table if each.name_in(wanted) is not None}
    unknown = [(name,) for name in wanted if not any(name in names for names in groups)]
    before = Reading({})
    if not unknown:
        before = yield ReadParameters(peer, tuple(groups))
        unknown = [*before.missing]
    if unknown:
        names = named([" or ".join(each) for each in unknown])
        return (), f"parameters: the vehicle has no {names}: nothing was set or uploaded"
    asked: dict[str, float] = {}
    for names_of_one, parameter in groups.items():
        name = next(each for each in names_of_one if each in before.settings)
        number = number_in(parameter, name, wanted)
        if number is not None and not same_value(number, before.settings[name].value):
            asked[name] = number
    for name, number in asked.items():
        kind = before.settings[name].kind
        if not (yield set_parameter(peer, name, Setting(number, kind))):
            break
    after: Reading = yield ReadParameters(peer, [(name,) for name in asked])
    changes = tuple(
        Change(name, before.settings[name].value, number, after.values.get(name))
        for name, number in asked.items()
    )
    failed = ", ".join(str(each) for each in changes if not each.made)
    problem = f"parameters: not set: {failed}: the mission was not uploaded" if failed else ""
    return changes, problem
