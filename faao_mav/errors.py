"""The exceptions that faao-mav raises on purpose."""


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
