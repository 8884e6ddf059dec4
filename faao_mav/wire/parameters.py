"""Reading and setting a vehicle's parameters by their names.

Source: MAVLink developer guide, "Parameter Protocol". ArduPilot sends whole numbers as numbers,
PX4 as their bits (its "byte-wise encoding").
"""

import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from faao_mav.autopilot import VehicleType, vehicle_types
from faao_mav.autopilot.parameter import Parameter
from faao_mav.errors import InputError
from faao_mav.wire.machine import AT_ONCE, Pace, Questions, Talk
from faao_mav.wire.messages import ParamRequestRead, ParamSet, ParamValue
from faao_mav.wire.protocol import listed
from faao_mav.wire.transfer import Peer

Names: TypeAlias = tuple[str, ...]
"""The names that one parameter has in the generations of an autopilot: a vehicle has one."""

_INT32 = 6  # MAV_PARAM_TYPE of whole numbers of 32 bits.

_AT_ONCE = 10  # Names that are asked for at once: half of ArduPilot's queue for them. Chosen.

_SILENCE = 4.0
"""Seconds without a new answer after which no more are asked for, or set. Chosen: a name that the
vehicle does not know costs these seconds; what they leave unread says `machine._LONGEST`."""


@dataclass(frozen=True, slots=True)
class Reading:
    """What was read: `values` and their `kinds` by name; of `missing` no name was answered.

    A kind is a MAV_PARAM_TYPE.
    """

    values: dict[str, float]
    missing: tuple[Names, ...] = ()
    kinds: Mapping[str, int] = field(default_factory=dict)


def value_in(message: ParamValue | ParamSet, vehicle: VehicleType | None) -> float:
    """Return what `message` says, in whose manner `vehicle` sends whole numbers."""
    value = message.param_value
    if vehicle is not None and vehicle.family.whole_as_bits and message.param_type == _INT32:
        (value,) = struct.unpack("<i", struct.pack("<f", value))
    return value


def carried(value: float, kind: int, vehicle: VehicleType | None) -> float:
    """Return the number that carries `value` of the type `kind`: the reverse of `value_in`."""
    if vehicle is not None and vehicle.family.whole_as_bits and kind == _INT32:
        whole = min(max(round(value), -(2**31)), 2**31 - 1)
        (value,) = struct.unpack("<f", struct.pack("<i", whole))
    return value


def same_value(one: float, other: float) -> bool:
    """Tell whether two numbers are one in the single precision of the wire."""
    return struct.pack("<f", one) == struct.pack("<f", other)


def read_parameters(
    peer: Peer, parameters: Iterable[Names], setting: Mapping[str, ParamSet] | None = None
) -> Talk[Reading]:
    """Read `parameters` of the vehicle of `peer`, each by all of its names.

    Those in `setting` are set, and missing unless the vehicle answers with that very value. It is
    told until it does: setting one twice does no harm.
    """
    line = yield AT_ONCE
    left, setting = list(dict.fromkeys(parameters)), setting or {}
    questions, total = Questions[Names](line, Pace(), _SILENCE), len(left)
    names_of = {name: names for names in left for name in names}
    values, kinds = dict[str, float](), dict[str, int]()
    while (left or questions.asked) and not questions.over:
        # Those that were put three times, which it may not have, make room for others.
        room = sum(len(names) for names, each in questions.asked.items() if each.times < 3)
        while left and room < _AT_ONCE:
            names = left.pop(0)
            room += len(names)
            reads = (ParamRequestRead(peer.address, name, -1) for name in names)
            questions.put(names, *(setting.get(each.param_id, each) for each in reads))
        done = total - len(left) - len(questions.asked)
        line.progress = f"{'setting' if setting else 'reading'} parameters", done, total
        heard = yield from questions.hear()
        told = None if heard is None else heard.said(peer.address, ParamValue)
        if told is None:
            continue
        name, value = told.param_id, value_in(told, peer.vehicle)
        if name in setting and not same_value(value, value_in(setting[name], peer.vehicle)):
            continue
        if questions.answer(names_of.get(name, ())):
            values[name], kinds[name] = value, told.param_type
            questions.further()
    return Reading(values, (*questions.asked, *left), kinds)


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
    other = name if name in given else parameter.name_in(given)
    if other is None or other == name:
        return given.get(name)
    return parameter.written(parameter.names[other] * given[other], name)


def check_settable(parameters: Mapping[str, float], source: object) -> None:
    """Raise `InputError`, which names `source`, for one not a mission's own, or a useless value.

    Its own are what shapes how some vehicle flies a mission; what decides about failsafes, fence,
    return and checks is for its pilot to set.
    """
    tables = (each.parameters.values() for each in vehicle_types())
    own = {name: each for table in tables for each in table if each.motion for name in each.names}
    other = [name for name in parameters if name not in own]
    if other:
        told = "not among what a mission is timed for, which alone is set with it"
        do = "set it with the ground station, and give the mission's own file"
        raise InputError(f"{source}: {listed(other)}: {told}; {do}")
    for name, number in parameters.items():
        if not own[name].is_usable(number, name):
            raise InputError(f"{source}: {name}: {number:g}; give {own[name].expected(name)}")


def set_parameters(wanted: Mapping[str, float], peer: Peer) -> Talk[tuple[tuple[Change, ...], str]]:
    """Give the vehicle of `peer` the parameters of its table that `wanted` names, and read them.

    Of the names of one parameter it sets the one that the vehicle has. Nothing is set if the
    vehicle does not know one. Return the changes, and in words what went wrong, "" for nothing.
    """
    table = () if peer.vehicle is None else peer.vehicle.parameters.values()
    groups = {tuple(each.names): each for each in table if each.name_in(wanted) is not None}
    known = {name for names in groups for name in names}
    before = Reading({}, tuple((name,) for name in wanted if name not in known))
    if not before.missing:
        before = yield from read_parameters(peer, groups)
    if before.missing:
        told = listed([" or ".join(each) for each in before.missing])
        return (), f"parameters: the vehicle has no {told}: nothing was set or uploaded"
    asked = {
        name: number
        for names, parameter in groups.items()
        for name in names
        if name in before.values
        if (number := number_in(parameter, name, wanted)) is not None
        if not same_value(number, before.values[name])
    }
    setting, names = dict[str, ParamSet](), [(name,) for name in asked]
    for name, number in asked.items():
        kind = before.kinds[name]
        setting[name] = ParamSet(peer.address, name, carried(number, kind, peer.vehicle), kind)
    yield from read_parameters(peer, names, setting)
    after = yield from read_parameters(peer, names)
    changes = tuple(
        Change(name, before.values[name], number, after.values.get(name))
        for name, number in asked.items()
    )
    failed = ", ".join(str(each) for each in changes if not each.made)
    problem = f"parameters: not set: {failed}: the mission was not uploaded" if failed else ""
    return changes, problem
