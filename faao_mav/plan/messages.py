"""What pydantic found wrong with a plan, as lines that name key, value and what is accepted."""

import difflib
from collections.abc import Iterator, Mapping

from pydantic import ValidationError

from faao_mav.errors import quote
from faao_mav.plan.keys import PlanKey, reference

MAX_LINES = 6
"""Lines of a message: chosen to fit a small terminal."""


def describe(error: ValidationError, source: str) -> str:
    """Return one line per finding (at most `MAX_LINES`), each naming `source`."""
    lines = list(dict.fromkeys(_lines(error)))
    more = len(lines) - MAX_LINES
    if more > 0:
        lines = [*lines[:MAX_LINES], f"and {more} more"]
    return "\n".join(f"{source}: {line}" for line in lines)


def _lines(error: ValidationError) -> Iterator[str]:
    known = reference()
    for detail in error.errors(include_url=False):
        # a step in angle brackets is pydantic's choice among several sections
        steps = [step for step in detail["loc"] if not str(step).startswith("<")]
        place = "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in steps)
        value, kind = detail["input"], detail["type"]
        keys = [step for step in steps if isinstance(step, str)]
        accepted = _accepted(known, *keys)
        if kind == "missing":
            problem = f"missing; give {accepted}"
        elif kind == "unexpected_keyword_argument":
            problem = f"unknown key; {_nearest(known, *keys)}"
        elif kind == "told":
            problem = detail["msg"]
        elif kind == "value_error":
            problem = f"{quote(value)}: {detail['ctx']['error']}; give {accepted}"
        elif kind == "finite_number":
            problem = f"{value} is not a finite number; give {accepted}"
        else:
            problem = f"{quote(value)} is not accepted; give {accepted}"
        yield f"{place.removeprefix('.')}: {problem}"


def _accepted(known: Mapping[str, PlanKey], *keys: str) -> str:
    """Return what the key at a path accepts, or the nearest known one above it."""
    while keys and ".".join(keys) not in known:
        keys = keys[:-1]
    return known[".".join(keys)].accepted if keys else "a mapping"


def _nearest(known: Mapping[str, PlanKey], *keys: str) -> str:
    """Return where an unknown key may belong."""
    *above, name = keys
    section = known.get(".".join(above))
    here = sorted(section.inside if section else (path for path in known if "." not in path))
    close = difflib.get_close_matches(name, here, n=1, cutoff=0.6)
    if close:
        return f"did you mean {close[0]}?"
    elsewhere = [path for path in known if path.rsplit(".", 1)[-1] == name]
    if elsewhere:
        return f"it belongs at {' or '.join(elsewhere)}"
    return f"known here: {', '.join(here)}"
