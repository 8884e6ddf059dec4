"""JSON whose every value knows its place, so that every complaint can name it."""

import json
import math
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

from faao_mav.errors import InputError, MissionFileError

_MAX_SHOWN = 40

T = TypeVar("T")


class _Object(dict[str, Any]):
    """A JSON object that remembers a key it was given twice."""

    repeated: str | None = None


class _Constant(str):
    """A number that JSON has no word for: NaN, Infinity."""


class Node:
    """One value of a JSON text, its place there (`mission.items[3].params[4]`) and its file."""

    def __init__(self, value: Any, place: str, source: str) -> None:
        self.value, self.place, self.source = value, place, source

    def error(self, expected: str) -> MissionFileError:
        """Return the complaint that this value is not what was expected."""
        where = f"{self.source}: {self.place}" if self.place else self.source
        return MissionFileError(f"{where}: {_shown(self.value)}; expected {expected}")

    def __contains__(self, key: str) -> bool:
        return key in self._checked(dict, "an object")

    def __getitem__(self, key: str) -> "Node":
        """Return the value of `key`; raise `MissionFileError` if this is no object that has it."""
        if key not in self:
            place = f"{self.place}.{key}" if self.place else key
            raise MissionFileError(f"{self.source}: {place}: is missing")
        return Node(self.value[key], f"{self.place}.{key}" if self.place else key, self.source)

    def items(self, length: int | None = None) -> list["Node"]:
        """Return the values of this array, of `length` if given."""
        what = "an array" if length is None else f"an array of {length} values"
        values = self._checked(list, what)
        if length is not None and len(values) != length:
            raise self.error(what)
        return [Node(value, f"{self.place}[{k}]", self.source) for k, value in enumerate(values)]

    def number(self) -> float:
        """Return this finite number."""
        value = math.inf
        if isinstance(self.value, int | float) and not isinstance(self.value, bool):
            try:
                value = float(self.value)
            except OverflowError:
                value = math.inf
        if not math.isfinite(value):
            raise self.error("a finite number")
        return value

    def number_or_null(self) -> float:
        """Return this finite number, NaN for null."""
        if self.value is None:
            return math.nan
        try:
            return self.number()
        except MissionFileError:
            raise self.error("a finite number or null (not set)") from None

    def integer(self, most: int) -> int:
        """Return this whole number from 0 to `most`, which may be written as 3.0."""
        value = self.value
        whole = isinstance(value, int | float) and not isinstance(value, bool)
        if not (whole and 0 <= value <= most and value == int(value)):
            raise self.error(f"a whole number from 0 to {most}")
        return int(value)

    def boolean(self) -> bool:
        """Return this truth value."""
        value: bool = self._checked(bool, "true or false")
        return value

    def text(self) -> str:
        """Return this string."""
        value: str = self._checked(str, "a string")
        return value

    def make(self, what: Callable[[], T]) -> T:
        """Return `what()`, with its `InputError` as a complaint about this value."""
        try:
            return what()
        except MissionFileError:
            raise
        except InputError as error:
            raise MissionFileError(f"{self.source}: {self.place}: {error}") from None

    def _checked(self, kind: type, expected: str) -> Any:
        if not isinstance(self.value, kind):
            raise self.error(expected)
        return self.value


def parse_json(text: str, source: str) -> Node:
    """Return the root of the JSON `text`, the content of the file `source`.

    Raises `MissionFileError` for what is no JSON or more than one meaning could be given to: a
    key that an object has twice, NaN and Infinity, nesting beyond any use.
    """
    try:
        value = json.loads(
            text.removeprefix("\ufeff"), object_pairs_hook=_object, parse_constant=_Constant
        )
    except json.JSONDecodeError as error:
        raise MissionFileError(
            f"{source}: line {error.lineno}, column {error.colno}: not JSON: {error.msg}"
        ) from None
    except RecursionError:
        raise MissionFileError(f"{source}: nested too deep for a plan") from None
    except ValueError:  # an integer of thousands of digits
        raise MissionFileError(f"{source}: a number of thousands of digits") from None
    root = Node(value, "", source)
    for node in _below(root):
        if isinstance(node.value, _Constant):
            raise node.error("a finite number or null (not set): JSON has no such number")
        if isinstance(node.value, _Object) and node.value.repeated is not None:
            place = f"{node.place}.{node.value.repeated}" if node.place else node.value.repeated
            raise MissionFileError(f"{source}: {place}: is there twice; remove one")
    return root


def _object(pairs: list[tuple[str, Any]]) -> _Object:
    result = _Object()
    for key, value in pairs:
        if key in result:
            result.repeated = key
        result[key] = value
    return result


def _below(root: Node) -> Iterator[Node]:
    """Yield `root` and all that is in it."""
    waiting = [root]
    while waiting:
        node = waiting.pop()
        yield node
        if isinstance(node.value, dict):
            waiting += [node[key] for key in node.value]
        elif isinstance(node.value, list):
            waiting += node.items()


def _shown(value: Any) -> str:
    """Return `value` as it stands in the file, cut short."""
    if isinstance(value, _Constant):
        text = str(value)
    elif isinstance(value, dict):
        text = "an object"
    elif isinstance(value, list):
        text = f"an array of {len(value)}"
    else:
        text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 3] + "..."
