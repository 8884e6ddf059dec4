"""JSON text to plain data, where it can have one meaning only."""

import json
from collections.abc import Iterator
from typing import Any, NamedTuple

from faao_mav.errors import MissionFileError, place_of


class _Odd(NamedTuple):
    """What stands in the tree for a value that no JSON can have."""

    problem: str


def parse_json(text: str) -> Any:
    """Return the JSON `text` as plain data.

    Raises `MissionFileError` for what is no JSON or more than one meaning could be given to: a
    key that an object has twice, NaN and Infinity, nesting beyond any use.
    """
    odd: list[_Odd] = []

    def mark(problem: str) -> _Odd:
        odd.append(_Odd(problem))
        return odd[-1]

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        made: dict[str, Any] = {}
        for key, value in pairs:
            made[key] = mark("is there twice; remove one") if key in made else value
        return made

    def constant(word: str) -> _Odd:
        return mark(f"{word}; expected a finite number or null (not set): JSON has no such number")

    try:
        tree = json.loads(text, object_pairs_hook=unique, parse_constant=constant)
        for steps, problem in _odd_in([], tree) if odd else ():
            raise MissionFileError(f"{place_of(steps)}: {problem}".removeprefix(": "))
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise MissionFileError(f"{where}: not JSON: {error.msg}") from None
    except RecursionError:
        raise MissionFileError("nested too deep for a plan") from None
    except ValueError:  # an integer of thousands of digits
        raise MissionFileError("a number of thousands of digits") from None
    return tree


def _odd_in(steps: list[str | int], value: Any) -> Iterator[tuple[list[str | int], str]]:
    """Yield the places below `steps` where something odd stands, and what is wrong with it."""
    if isinstance(value, _Odd):
        yield steps, value.problem
    inside = value.items() if isinstance(value, dict) else ()
    for key, below in enumerate(value) if isinstance(value, list) else inside:
        yield from _odd_in([*steps, key], below)
