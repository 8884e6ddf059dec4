"""What a vehicle does by itself when a link, its battery or its position is lost."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

Values: TypeAlias = Mapping[str, float]
"""Parameters by the autopilot's names, in its units."""


@dataclass(frozen=True, slots=True)
class Response:
    """What a vehicle does about a loss, as the end of a sentence; `acts`: it does anything."""

    text: str
    acts: bool = True


@dataclass(frozen=True, slots=True)
class Failsafe:
    """What a vehicle does when `loss`, the beginning of a sentence, happens in flight.

    `response(values, streamed)` is what it does by the values of its parameters, in a flight by
    setpoints (`streamed`) or by its mission; it raises KeyError for one that decides and is
    missing. `defaults` are those of the autopilot; a whole number is one of 32 bits on PX4's wire.
    `absent` has the values that count in versions that lack the parameter.
    """

    loss: str
    defaults: Values
    response: Callable[[Values, bool], Response]
    absent: Values = field(default_factory=dict)

    def told(self, values: Values, *, streamed: bool) -> Response | None:
        """Return what a vehicle with these `values` does; None where one that decides is missing.

        >>> def response(values, streamed):
        ...     return Response("returns") if values["FS"] else Response("flies on", acts=False)
        >>> failsafe = Failsafe("RC lost", {"FS": 1.0}, response)
        >>> failsafe.told({"FS": 0.0}, streamed=False)
        Response(text='flies on', acts=False)
        >>> failsafe.told({}, streamed=False) is None
        True
        """
        try:
            return self.response({**self.absent, **values}, streamed)
        except KeyError:
            return None


def setting(name: str, values: Values) -> str:
    """Return a parameter with its value, as a message shows it."""
    return f"{name} {values[name]:g}"


def chosen(name: str, values: Values, actions: Mapping[int, str]) -> Response:
    """Return what `actions` say of the value of the parameter `name`; 0 is for nothing.

    >>> chosen("GF", {"GF": 2.0}, {2: "holds"})
    Response(text='holds (GF 2)', acts=True)
    >>> chosen("GF", {"GF": 0.0}, {2: "holds"}).text, chosen("GF", {"GF": 9.0}, {}).text
    ('does nothing (GF 0)', 'does what GF 9 says, which is not known here')
    """
    number, told = int(values[name]), setting(name, values)
    if number == 0 and 0 not in actions:
        return Response(f"does nothing ({told})", acts=False)
    if number not in actions:
        return Response(f"does what {told} says, which is not known here")
    return Response(f"{actions[number]} ({told})")
