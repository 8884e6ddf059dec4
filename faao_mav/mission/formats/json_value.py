"""Values of JSON files that know where they stand, so that every complaint can name its place."""

import json
import math
import sys
from collections import Counter
from collections.abc import Callable
from typing import Any, TypeVar

from faao_mav.errors import InputError, MissionFileError, place_of, quote

Made = TypeVar("Made")


class Json:
    """A value of a JSON file, and the keys and numbers that lead to it.

    What it is asked for and is not, it tells as a `MissionFileError` with its place, itself and
    what is expected.
    """

    def __init__(self, value: Any, *steps: str | int) -> None:
        self.value, self.steps = value, steps

    @classmethod
    def parsed(cls, text: str) -> "Json":
        """Return what `text` holds; raise `MissionFileError` where a key is there twice."""
        try:
            return cls(json.loads(text, object_pairs_hook=_unique))
        except json.JSONDecodeError as error:
            where = f"line {error.lineno}, column {error.colno}"
            raise MissionFileError(f"{where}: not JSON: {error.msg}") from None
        except ValueError:  # an integer of thousands of digits
            raise MissionFileError("a number of thousands of digits") from None

    @property
    def place(self) -> str:
        """Where the value stands, as messages name it."""
        return place_of(self.steps)

    def wrong(self, expected: str) -> MissionFileError:
        """Return the complaint that the value is not what is `expected`."""
        told = f"{self.place}: {quote(self.value)}; expected {expected}"
        return MissionFileError(told.removeprefix(": "))

    def checked(self, right: bool, expected: str) -> Any:
        """Return the value where it is `right`."""
        if not right:
            raise self.wrong(expected)
        return self.value

    @property
    def members(self) -> dict[str, Any]:
        """The values of the object by their keys."""
        found: dict[str, Any] = self.checked(isinstance(self.value, dict), "an object")
        return found

    def get(self, key: str) -> "Json | None":
        """Return what the object has under `key`, None for nothing or null."""
        value = self.members.get(key)
        return None if value is None else Json(value, *self.steps, key)

    def __getitem__(self, key: str) -> "Json":
        if (found := self.get(key)) is None:
            raise MissionFileError(f"{place_of((*self.steps, key))}: is missing")
        return found

    def each(self, most: float = math.inf) -> "list[Json]":
        """Return the values of the list, `most` at most."""
        values = self.checked(isinstance(self.value, list), "a list")
        if len(values) > most:
            raise MissionFileError(
                f"{self.place}: more than {most:,} values, and no autopilot keeps so many"
            )
        return [Json(value, *self.steps, k) for k, value in enumerate(values)]

    def one_of(self, *words: str) -> str:
        """Return the value, one of `words`."""
        return str(self.checked(self.value in words, " or ".join(map(repr, words))))

    def whole(self, most: int) -> int:
        """Return the whole number from 0 to `most`; some writers have 3.0 for 3."""
        right = _is_number(self.value) and 0 <= self.value <= most and not self.value % 1
        return int(self.checked(right, f"a whole number from 0 to {most}"))

    def flag(self) -> bool:
        """Return true or false."""
        return bool(self.checked(isinstance(self.value, bool), "true or false"))

    def number(self, null: str = "") -> float:
        """Return the number; with `null`, which says what it means, NaN for a null."""
        if null and self.value is None:
            return math.nan
        meaning = f" or null ({null})" if null else ""
        return float(self.checked(_is_number(self.value), f"a finite number{meaning}"))

    def numbers(self, count: int, null: str = "") -> list[float]:
        """Return so many numbers, each as `number` does."""
        values = self.each()
        self.checked(len(values) == count, f"a list of {count} values")
        return [each.number(null) for each in values]

    def made(self, make: Callable[..., Made], *arguments: Any) -> Made:
        """Return `make(*arguments)`, with its `InputError` as a complaint about this place."""
        try:
            return make(*arguments)
        except InputError as error:
            raise MissionFileError(f"{self.place}: {error}") from None


def _is_number(value: Any) -> bool:
    """Return whether `value` is a finite number that a float can be."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and abs(value) <= sys.float_info.max


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        (twice, _), *_ = Counter(key for key, _ in pairs).most_common(1)
        raise MissionFileError(f"key {quote(twice)}: is there twice in one object; remove one")
    return made
