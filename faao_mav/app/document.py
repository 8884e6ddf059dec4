"""The text of a plan while it is edited: values by key, comments kept, undo and redo."""

import io
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path as File
from typing import Any, TypeAlias

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import YAMLError

from faao_mav.errors import PlanError
from faao_mav.files import read_text, write_whole
from faao_mav.plan.yaml_text import MAX_CHARACTERS, load_yaml

Step: TypeAlias = str | int
Path: TypeAlias = tuple[Step, ...]
"""Keys and numbers of list entries from the top of a plan."""

_INDENT = re.compile(r"^( +)[^\s#-]", re.MULTILINE)
_DASHES = re.compile(r"^( *)[^\s#-][^\n]*:[ ]*(?:#.*)?\n\s*?( *)- ", re.MULTILINE)
"""How far a text indents the keys of a section, and a list's dashes from the list's key."""

_WIDTH = 4096  # characters of a line at which long values are folded. Chosen


class Document:
    r"""The text of a plan and its earlier texts.

    What is not changed stays as it was written: comments, order, the style of each value.

    >>> document = Document("flight: {duration: 120}  # s\n")
    >>> document.put(("flight", "duration"), 150)
    >>> print(document.text, end="")
    flight: {duration: 150}  # s
    >>> document.undo()
    >>> document.shown(("flight", "duration"))
    '120'
    """

    def __init__(self, text: str, source: str = "plan.yaml", path: File | None = None) -> None:
        """Raise `PlanError` for a `text` that is no YAML mapping; `source` names it.

        `path` is the file that has the text, where `save` writes it.
        """
        load_yaml(text, source)
        self.source, self.path = source, path
        self._texts, self._at = [text], 0
        self._gesture: object = None
        self._on_disk = text

    @classmethod
    def open(cls, path: File | None) -> "Document":
        """Return the plan of the file `path`, or a new one; raises `PlanError` where it is none."""
        if path is None:
            return cls(File(__file__).with_name("new.yaml").read_text(encoding="utf-8"))
        return cls(_read(path), str(path), path)

    @property
    def text(self) -> str:
        """The text as it is now."""
        return self._texts[self._at]

    @property
    def saved(self) -> bool:
        """Whether the text is that of the file."""
        return self.text == self._on_disk

    @property
    def can_undo(self) -> bool:
        """Whether there is an earlier text."""
        return self._at > 0

    @property
    def can_redo(self) -> bool:
        """Whether there is a text that was undone."""
        return self._at + 1 < len(self._texts)

    def undo(self) -> None:
        """Go back to the text before the last change."""
        self._at, self._gesture = max(0, self._at - 1), None

    def redo(self) -> None:
        """Take the last `undo` back."""
        self._at, self._gesture = min(len(self._texts) - 1, self._at + 1), None

    def value(self, path: Path) -> Any:
        """Return the plain value at `path`, not to be changed; None where there is none."""
        at = _parsed(self.text, self.source)
        for step in path:
            inside = isinstance(at, dict) if isinstance(step, str) else isinstance(at, list)
            try:
                at = at[step] if inside else None
            except LookupError:
                return None
        return at

    def shown(self, path: Path) -> str:
        """Return the value at `path` as one line of YAML; nothing where there is none."""
        if (value := self.value(path)) is None:
            return ""
        yaml, text = YAML(), io.StringIO()
        yaml.default_flow_style, yaml.width = True, _WIDTH
        yaml.dump({"k": value}, text)
        return text.getvalue().strip()[len("{k: ") : -1]

    def write(self, path: Path, text: str) -> None:
        """Put the value that `text` has in YAML at `path`; nothing stands for no value.

        What is no YAML is put there as text, for the plan to say what would be accepted.
        """
        if not text.strip():
            self.remove(path)
            return
        try:
            self.put(path, YAML().load(text))
        except (YAMLError, ValueError, PlanError):  # of sound YAML plans do not use all, as aliases
            self.put(path, text)

    def put(self, path: Path, value: object, gesture: object = None) -> None:
        """Put `value` at `path`; a change of the same `gesture` as the last one replaces that.

        Raises `PlanError`, and changes nothing, for a value that no plan may hold.
        """
        with self._edited(gesture) as at:
            for step in path[:-1]:
                if isinstance(step, str) and not isinstance(at.get(step), Mapping | list):
                    at[step] = {}
                at = at[step]
            if isinstance(at, list) and path[-1] == len(at):
                at.append(_flow(value))
            else:
                at[path[-1]] = _flow(value)

    def remove(self, path: Path) -> None:
        """Take out what stands at `path`, if anything does."""
        if self.value(path) is None and self.value(path[:-1]) is None:
            return
        with self._edited() as at:
            for step in path[:-1]:
                at = at[step]
            last: Any = path[-1]
            if isinstance(at, list) or last in at:
                del at[last]

    def replace(self, text: str, source: str) -> None:
        """Take another plan, `text`, of the name `source`; the old one can be had by undo.

        It is of no file that `save` may write. Raises `PlanError` as the constructor does.
        """
        load_yaml(text, source)
        self.source, self.path, self._gesture = source, None, None
        self._texts = [*self._texts[: self._at + 1], text]
        self._at += 1

    def save(self) -> None:
        """Write the text to its file, unless that was changed by something else.

        Raises `InputError` where it was, and where the file cannot be read or written.
        """
        if self.path is None or _read(self.path) != self._on_disk:
            raise PlanError(
                f"{self.source} was changed since it was opened here; download the plan instead"
            )
        write_whole(self.path, self.text.encode())
        self._on_disk = self.text

    @contextmanager
    def _edited(self, gesture: object = None) -> Iterator[Any]:
        """Give the data to change; their text becomes the document's, if a plan may have it."""
        yaml, written = YAML(), io.StringIO()
        yaml.brace_single_entry_mapping_in_flow_sequence = True
        yaml.preserve_quotes, yaml.width = True, _WIDTH
        keys, dashes = _INDENT.search(self.text), _DASHES.search(self.text)
        offset = len(dashes[2]) - len(dashes[1]) if dashes else 0
        yaml.indent(mapping=len(keys[1]) if keys else 2, sequence=offset + 2, offset=offset)
        data = yaml.load(self.text)
        yield data
        yaml.dump(data, written)
        if (text := written.getvalue()) == self.text:
            return
        again = gesture is not None and gesture == self._gesture
        _parsed(text, self.source)
        kept = self._texts[: self._at if again else self._at + 1]
        self._texts = [*kept, text]
        self._at, self._gesture = len(kept), gesture


def _read(path: File) -> str:
    return read_text(path, 4 * MAX_CHARACTERS, "a plan", PlanError)


@lru_cache(maxsize=16)
def _parsed(text: str, source: str) -> Any:
    return load_yaml(text, source)


def problems_of(error: str, source: str, paths: Sequence[str]) -> dict[str, str]:
    r"""Return what `error` says by the path, of `paths`, that each line is about; "": of none.

    >>> problems_of("p: flight.start: bad\np: odd", "p", ["flight.start"])
    {'flight.start': 'bad', '': 'odd'}
    """
    found: dict[str, str] = {}
    for line in error.splitlines():
        told = line.removeprefix(f"{source}: ")
        key, _, problem = told.partition(": ")
        above = [p for p in paths if key == p or key.startswith((f"{p}.", f"{p}["))]
        path = max(above, key=len, default="")
        said = (problem if key == path else told) if path else told
        found[path] = f"{found[path]}\n{said}" if path in found else said
    return found


def _flow(value: object) -> object:
    """Return `value` as it is written into a plan: lists and mappings in one line."""
    if isinstance(value, Mapping):
        held: Any = CommentedMap((key, _flow(each)) for key, each in value.items())
    elif isinstance(value, list | tuple):
        held = CommentedSeq(map(_flow, value))
    else:
        return value
    held.fa.set_flow_style()
    return held
