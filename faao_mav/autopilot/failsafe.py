"""What a vehicle does by itself when a link, its battery or its position is lost: `failsafes.tsv`.

A row of the table is one stage of what a vehicle does about a loss. Columns, "-" for nothing:

- `vehicle`, `loss`
- `defaults`: the parameters that decide, with the autopilot's defaults; a whole number is one of 32
  bits on PX4's wire
- `absent`: the values that count in versions without the parameter
- `off`: a parameter, and the values with which nothing is done
- `flies on by`: a parameter, and its bits in a mission and in a flight by setpoints, with which the
  vehicle flies on
- `decides`, `does`: a parameter, and what is done by its values from 1 on, between bars; "" where
  that is not known; names in braces stand for the values of parameters
- `idle`: values of `decides` with which nothing is done, or the mission goes on
- `after`: the parameter that says after how many seconds
- `below`: the parameters below which it acts, with their units; with 0 it does not
- `when`: when that is, as the beginning of what is done

Sources: ArduPilot's lists of parameters and events of Copter and Plane 4.1 to 4.7; PX4 1.14 to
1.16: parameter reference, and the module commander (behaviour of its failsafes).
"""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import NamedTuple, TypeAlias

Values: TypeAlias = Mapping[str, float]
"""Parameters by the autopilot's names, in its units."""


class Response(NamedTuple):
    """What a vehicle does about a loss, as the end of a sentence; `acts`: it does anything."""

    text: str
    acts: bool


@dataclass(frozen=True, slots=True)
class Failsafe:
    """What a vehicle does when `loss`, the beginning of a sentence, happens in flight.

    `stages` are its rows of the table, `defaults` the parameters that decide, as they come, and
    `absent` the values that count in versions that lack the parameter.
    """

    loss: str
    stages: tuple[Mapping[str, str], ...]
    defaults: Values
    absent: Values

    def told(self, values: Values, *, streamed: bool) -> Response | None:
        """Return what a vehicle with these `values` does; None where one that decides is missing.

        `streamed`: in a flight by setpoints, else by its mission.

        >>> failsafe = failsafes("px4")[1]
        >>> failsafe.told({"NAV_DLL_ACT": 2, "COM_DL_LOSS_T": 10}, streamed=False)
        Response(text='returns (NAV_DLL_ACT 2) after 10 s (COM_DL_LOSS_T)', acts=True)
        >>> failsafe.told({}, streamed=False) is None
        True
        """
        values = {**self.absent, **values}
        try:
            told = [_told(stage, values) for stage in self.stages]
            acts = any(each.acts for each in told)
            if acts and (exception := self.stages[0]["flies on by"]):
                name, *bits = exception.split()
                if int(values[name]) & int(bits[streamed]):
                    return Response(f"flies on ({name} {values[name]:g})", acts=False)
        except KeyError:
            return None
        return Response("; ".join(dict.fromkeys(each.text for each in told if each.text)), acts)


def _told(stage: Mapping[str, str], values: Values) -> Response:
    """Return what a vehicle with these `values` does by a `stage`; "" for nothing to tell."""
    name, _, off = stage["off"].partition("=")
    if name and f"{values[name]:g}" in off.split(","):
        return Response(f"does nothing ({name} {values[name]:g})", acts=False)
    below = dict(each.split(" ", 1) for each in stage["below"].split("|") if each)
    limits = [f"{values[name]:g} {unit}" for name, unit in below.items() if values[name]]
    if below and not limits:
        nothing = "" if stage["when"] else f"does nothing: {' and '.join(below)} are 0"
        return Response(nothing, acts=False)
    decides, does, when = stage["decides"], stage["does"].split("|"), stage["when"]
    if not decides:
        return Response(does[0], acts=True)
    number, set_to = int(values[decides]), f"{decides} {values[decides]:g}"
    text = does[number - 1] if 0 < number <= len(does) else ""
    acts = str(number) not in stage["idle"].split(",")
    if text:
        text = f"{text.format_map(values)} ({set_to})"
    elif not acts:
        return Response(f"{when}does nothing ({set_to})", acts=False)
    else:
        text = f"does what {set_to} says, which is not known here"
    text += f" after {values[stage['after']]:g} s ({stage['after']})" if stage["after"] else ""
    return Response(f"{when}{text}{' at ' * bool(limits)}{' or '.join(limits)}", acts)


_TABLE = files("faao_mav.autopilot").joinpath("failsafes.tsv")


@cache
def failsafes(vehicle: str, table: Traversable = _TABLE) -> tuple[Failsafe, ...]:
    """Return what the `vehicle` of a `table` does, loss by loss.

    >>> [each.loss for each in failsafes("arduplane")]
    ['RC lost', 'ground station lost', 'battery low']
    """
    text = table.read_text(encoding="utf-8")
    found: dict[str, list[dict[str, str]]] = {}
    for row in csv.DictReader(text.splitlines(), delimiter="\t"):
        if row["vehicle"] == vehicle:
            stage = {key: "" if value == "-" else value for key, value in row.items()}
            found.setdefault(row["loss"], []).append(stage)

    def numbers(stages: list[dict[str, str]], column: str) -> Values:
        pairs = (each.split("=") for stage in stages for each in stage[column].split())
        return {name: float(value) if "." in value else int(value) for name, value in pairs}

    return tuple(
        Failsafe(loss, tuple(stages), numbers(stages, "defaults"), numbers(stages, "absent"))
        for loss, stages in found.items()
    )
