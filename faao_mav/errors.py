"""The exceptions that faao-mav raises on purpose, and values as their messages show them."""

from collections.abc import Sequence
from importlib.util import find_spec

_MAX_SHOWN = 60
"""Characters of a value or a key that a message shows; chosen: a message stays within two lines."""


class FaaoError(Exception):
    """Root of every error that the caller can act on; the message says how.

    The message shows characters that a terminal may act on as their codes, but for the ends of
    its lines.

    >>> from faao_mav import read_mission
    >>> try:
    ...     read_mission("nowhere.plan")
    ... except FaaoError as error:
    ...     print(type(error).__name__, "-", error)
    MissionFileError - nowhere.plan: cannot be read: No such file or directory
    """

    def __str__(self) -> str:
        return "\n".join(map(printable, super().__str__().split("\n")))


class InputError(FaaoError):
    """What was given cannot be used: a plan, an argument, a file.

    >>> from faao_mav import Limits
    >>> Limits(max_speed=-1.0)
    Traceback (most recent call last):
        ...
    faao_mav.errors.InputError: max_speed: -1.0; expected a number above 0
    """


class PlanError(InputError):
    """A plan cannot be read or asks for something impossible.

    >>> from faao_mav import read_plan
    >>> plan = read_plan("missions/copter_relay.yaml")
    >>> plan.changed({"flight.duration": "long"})  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    faao_mav.errors.PlanError: missions/copter_relay.yaml: flight.duration: 'long' is not ...
    """


class MissionFileError(InputError):
    """A mission file cannot be read or written.

    >>> from faao_mav import read_mission
    >>> read_mission("missions/copter_relay.yaml")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    faao_mav.errors.MissionFileError: missions/copter_relay.yaml: '.yaml'; expected a name that ...
    """


class ParameterFileError(InputError):
    """A file of autopilot parameters cannot be read or written.

    >>> from faao_mav import read_parameters
    >>> read_parameters("nowhere.param")
    Traceback (most recent call last):
        ...
    faao_mav.errors.ParameterFileError: nowhere.param: cannot be read: No such file or directory
    """


class InfeasibleError(FaaoError):
    """The input is sound, but nothing satisfies it: no trajectory, no mission within the limits.

    >>> from faao_mav import convert, optimize, read_plan
    >>> few = {"radio.fading": "none", "mission.max_items": 5}
    >>> solution = optimize(read_plan("missions/copter_relay.yaml").changed(few))
    >>> convert(solution)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    faao_mav.errors.InfeasibleError: ... mission.max_items ...
    """


class SolverError(FaaoError):
    """A numerical solver gave up before there was anything to return.

    >>> issubclass(SolverError, FaaoError), issubclass(SolverError, InputError)
    (True, False)
    """


class LinkError(FaaoError):
    """A vehicle cannot be reached, or did not do what was asked.

    >>> from faao_mav import download
    >>> download("udpout:127.0.0.1:9", wait=0.1)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    faao_mav.errors.LinkError: udpout:127.0.0.1:9: no heartbeat of an autopilot within 0.1 s; ...
    """


class HangUp(KeyboardInterrupt):
    """The terminal has gone, and with it whoever could interrupt a second time."""


def check_extra(name: str, module: str, purpose: str) -> None:
    """Check that the extra `name` of the package, which brings `module`, is installed.

    Where it is not, raises `InputError`: what `purpose` needs, and how to install it.
    """
    if find_spec(module) is None:
        raise InputError(
            f"{purpose} needs {module}, which is not installed: "
            f"pip install '.[{name}]' in a checkout of faao-mav"
        )


def quote(value: object) -> str:
    r"""Return `value` as a message shows it, in the words of YAML, in one line, cut short.

    >>> quote("slow"), quote(None), quote([True, 2.5]), quote({"least": 1}), quote({})
    ("'slow'", 'null', '[true, 2.5]', '{least: 1}', 'nothing')
    >>> print(quote({"a\nb": 1}))
    {a\nb: 1}
    """
    if isinstance(value, dict | list) and not value:
        return "nothing"
    if isinstance(value, dict):
        keys = {key: printable(shortened(str(key))) for key in [*value][:_MAX_SHOWN]}
        shown = f"{{{', '.join(f'{keys[key]}: {quote(value[key])}' for key in keys)}}}"
    elif isinstance(value, list):
        shown = f"[{', '.join(map(quote, value[:_MAX_SHOWN]))}]"
    elif isinstance(value, bool):
        shown = str(value).lower()
    else:
        shown = "null" if value is None else repr(value)
    return shortened(shown)


def place_of(steps: Sequence[str | int]) -> str:
    """Return where a value stands in a file of nested data, as a message names it.

    >>> place_of(["mission", "items", 3, "params"])
    'mission.items[3].params'
    """
    named = (f"[{s}]" if isinstance(s, int) else f".{shortened(printable(s))}" for s in steps)
    return "".join(named).removeprefix(".")


def printable(text: str) -> str:
    r"""Return `text` in one line, with characters that a terminal may act on as their codes.

    >>> print(printable("80 % \x1b[2J done"))
    80 % \x1b[2J done
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shortened(text: str, most: int = _MAX_SHOWN) -> str:
    """Return `text`, cut to `most` characters.

    >>> shortened("123456789", 8)
    '12345...'
    """
    return text if len(text) <= most else text[: most - 3] + "..."


def counted(number: int, noun: str) -> str:
    """Return "1 area" or "2 areas".

    >>> counted(1, "area"), counted(0, "area")
    ('1 area', '0 areas')
    """
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
