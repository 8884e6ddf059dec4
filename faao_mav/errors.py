"""The exceptions that faao-mav raises on purpose, and values as their messages show them."""

_MAX_SHOWN = 60
"""Characters of a value that a message shows; chosen: a message stays within two lines."""


class FaaoError(Exception):
    """Root of every error that the caller can act on; the message says how."""


class InputError(FaaoError):
    """What was given cannot be used: a plan, an argument, a file."""


class PlanError(InputError):
    """A plan cannot be read or asks for something impossible."""


class MissionFileError(InputError):
    """A mission file cannot be read or written."""


class ParameterFileError(InputError):
    """A file of autopilot parameters cannot be read or written."""


class InfeasibleError(FaaoError):
    """The input is sound, but nothing satisfies it: no trajectory, no mission within the limits."""


class SolverError(FaaoError):
    """A numerical solver gave up before there was anything to return."""


class LinkError(FaaoError):
    """A vehicle cannot be reached, or did not do what was asked."""


def quote(value: object) -> str:
    """Return `value` as a message shows it, in one line, cut short.

    >>> quote("slow"), quote(None), quote(True), quote([1, 2.5]), quote({})
    ("'slow'", 'null', 'true', '[1, 2.5]', 'nothing')
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict | list) and not value:
        return "nothing"
    text = "null" if value is None else repr(value)
    return text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 3] + "..."
