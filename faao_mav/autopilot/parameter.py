"""One record for each parameter of an autopilot: its names, unit, default and bounds."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Protocol, TypeAlias

from faao_mav import files
from faao_mav.autopilot.body import Body

_GENTLE = (1.35, 2.0)
"""The gentle accelerations to try, as multiples of a_max: 1.35 makes up for the time that
a jerk-limited ramp loses (measured: 1.3 to 1.4 on near-straight plans); 2 is chosen."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of an autopilot.

    `key` is what this package calls it, `unit` the unit of `default`, `least` and `greatest`: SI,
    angles in radians; "" for switches, bits and gains. `names` are the autopilot's own names, the
    newest generation first, each with the factor that turns its number into `unit`: a vehicle
    knows one generation, a parameter file may carry both. Values outside `least` to `greatest` are
    no use (of a parameter of `either_sign`: their size). The autopilot lowers the value to that of
    the parameter `capped_by`. `motion`: it shapes how the vehicle flies a mission; the others
    decide about checks, storage, fence and return.

    >>> speed = Parameter("cruise_speed", "m/s", 10.0, {"WP_SPD": 1.0, "WPNAV_SPEED": 0.01})
    >>> speed.name_in({"WPNAV_SPEED": 750})
    'WPNAV_SPEED'
    >>> speed.written(7.5, "WPNAV_SPEED"), speed.written(7.5, "WP_SPD")
    (750, 7.5)
    >>> Parameter("rally_limit", "m", 300.0, {"RALLY_LIMIT_KM": 1e3}).written(300, "RALLY_LIMIT_KM")
    0.3
    """

    key: str
    unit: str
    default: float
    names: Mapping[str, float]
    least: float = -math.inf
    greatest: float = math.inf
    either_sign: bool = False
    capped_by: str = ""
    motion: bool = True

    @property
    def newest_name(self) -> str:
        """The name in the newest generation."""
        return next(iter(self.names))

    @property
    def oldest_name(self) -> str:
        """The name in the oldest generation."""
        return list(self.names)[-1]

    def name_in(self, given: Mapping[str, float]) -> str | None:
        """Return the newest of the names that `given` has, None if it has none."""
        return next((name for name in self.names if name in given), None)

    def is_usable(self, number: float, name: str) -> bool:
        """Tell whether the autopilot's `number` under `name` is within the bounds."""
        value = self.names[name] * (abs(number) if self.either_sign else number)
        # The bounds themselves are usable, whatever the factor rounds to.
        slack = 1e-12 * abs(value) if math.isfinite(value) else 0.0
        return math.isfinite(value) and self.least - slack <= value <= self.greatest + slack

    def expected(self, name: str) -> str:
        """Return in words which numbers under `name` are of use."""
        factor, limits = self.names[name], {"at least": self.least, "at most": self.greatest}
        finite = {word: limit for word, limit in limits.items() if math.isfinite(limit)}
        bounds = [f"{word} {limit / factor:g}" for word, limit in finite.items()]
        sign = " of either sign" if self.either_sign else ""
        return f"a number{' of ' if bounds else ''}{' and '.join(bounds)}{sign}"

    def written(self, value: float, name: str) -> float:
        """Return `value`, in `unit`, as the autopilot's number under `name`.

        Centimetres and the like are whole numbers, kilometres are not.
        """
        factor = self.names[name]
        return round(value / factor) if factor < 1.0 else value / factor


ParameterTable: TypeAlias = Mapping[str, Parameter]
"""The parameters of one vehicle by `Parameter.key`."""


class ParameterValues(Protocol):
    """Where values of parameters, and the airframe, come from: a `Vehicle`."""

    @property
    def airframe(self) -> Body | None:
        """The airframe, None where there is none."""

    def value(self, key: str) -> float:
        """Return the value of the parameter `key` in the unit of its table."""


def table(*parameters: Parameter) -> ParameterTable:
    """Return `parameters` by key; of two with one key the later one counts."""
    return MappingProxyType({parameter.key: parameter for parameter in parameters})


def in_si(unit: str, names: Mapping[str, float], *told: float, **more: Any) -> Parameter:
    """Return a parameter without a key, `told` its default, least and greatest value.

    Of angles all numbers, and what the factors of `names` lead to, are degrees.
    """
    turn = math.radians(1) if unit.startswith("rad") else 1
    default, least, greatest = (turn * each for each in told)
    names = {name: turn * factor for name, factor in names.items()}
    return Parameter("", unit, default, names, least, greatest, **more)


def parameters_of(vehicle: str) -> Iterator[Parameter]:
    """Yield those of the table `parameters.tsv`, beside the fields of flight models.

    Its columns are the fields of `Parameter`, angles in degrees; a name has its factor behind a
    star, switches and bits have whole numbers. A negative `loiter_radius` turns left; a
    `return_height` below 0 keeps the height at which the return begins. Sources: ArduPilot's lists
    of parameters, 4.7, with the names up to 4.7 second; PX4's parameter reference, 1.16.
    """
    for row in files.table("autopilot/parameters.tsv"):
        if vehicle in row["vehicles"].split():
            default, names = row["default"], (each.split("*") for each in row["names"].split())
            parameter = in_si(
                row["unit"],
                {name: float(factor[0]) if factor else 1.0 for name, *factor in names},
                float(default) if "." in default else int(default),
                float(row["least"] or -math.inf),
                float(row["greatest"] or math.inf),
                either_sign=bool(row["sign"]),
                motion=bool(row["motion"]),
            )
            yield replace(parameter, key=row["key"])


@dataclass(frozen=True, slots=True)
class Recommended:
    """The parameters that are recommended for a plan; measured: about 130 flights.

    `curved`, m/s², is the acceleration for corners and short legs at speed, `documented` between
    which it may be by the autopilot's documentation, and `others` are more parameters by their
    keys. In one more set, for bends at speed, they are the `liveliest`.
    """

    curved: float
    documented: tuple[float, float]
    others: Mapping[str, float] = field(default_factory=dict)
    liveliest: Mapping[str, float] = field(default_factory=dict)

    def sets(
        self, table: ParameterTable, speeds: tuple[float, float], max_acceleration: float
    ) -> tuple[Mapping[str, float], ...]:
        """Return the sets to try, the gentlest first, for a plan's a_max, m/s².

        `speeds`, m/s, are the greatest of the plan and the greatest that is commanded. Names are
        those of both generations: a vehicle takes those that it knows.
        """
        low, high = self.documented
        wanted = (*(share * max_acceleration for share in _GENTLE), self.curved)
        tries = sorted({round(min(max(each, low), high), 2) for each in wanted})
        tried = [(each, self.others) for each in tries]
        if self.liveliest:
            tried.append((tries[-1], self.liveliest))
        told = {"cruise_speed": speeds[0]}
        if "max_speed" in table and speeds[1] > table["max_speed"].default:
            told["max_speed"] = speeds[1]
        sets = [{**told, "acceleration": a, **others} for a, others in tried]
        return tuple(
            {
                name: table[key].written(value, name)
                for generation in (-1, 0)
                for key, value in each.items()
                for name in [list(table[key].names)[generation]]
            }
            for each in sets
        )
