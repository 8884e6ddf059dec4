"""YAML text to plain Python data and back, by the core schema of YAML 1.2.

`1e-4` is a number, `010` is ten, `no` and `2:30` are words, and a key that stands twice is an
error. What plans have no use for is refused before it is built: anchors' aliases, tags, nesting.
"""

import hashlib
import io
import re
from collections.abc import Mapping
from typing import Any, ClassVar

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import AliasEvent
from ruamel.yaml.nodes import MappingNode, ScalarNode
from ruamel.yaml.representer import SafeRepresenter
from ruamel.yaml.resolver import VersionedResolver

from faao_mav.errors import PlanError, shortened
from faao_mav.mission.fence import MAX_CORNERS
from faao_mav.radio.map_file import WORD

MAX_CHARACTERS = 80 * MAX_CORNERS
"""Characters of the longest plan that is read: a corner of the fence, written in degrees with all
their digits, takes 76, and a plan of every other key 3,000."""

_MAX_VALUES = 6 * MAX_CORNERS
"""Keys, values, lists and mappings of the largest plan that is read: a corner of the fence, in
degrees, is 5, and a plan of every other key 300. So many take 3 s."""

_MAX_DEPTH = 20
"""Levels of nesting that are read; chosen: a plan has at most six."""

_MAX_PROBLEM = 200
"""Characters of what a message says of a fault, which may repeat a word of any length; chosen."""

_MAX_WIDTH = 4096
"""Characters of a line at which long values are folded when written; chosen."""

_LONG_WORD = re.compile(rf"{WORD}[A-Za-z0-9+/=]{{100,}}")
"""A word such as a map's, which does not go through YAML: that takes a microsecond a character."""

_STAND_IN = re.compile(r"long-word-[0-9a-f]{64}")
"""What stands for it there, by its SHA-256."""

_CORE_SCHEMA = {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?[0-9]+",
    "float": r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
    r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
}
"""The types of the words that are no text, with their patterns: without 0x, 0o and dates."""


_TEXT = "tag:yaml.org,2002:str"


class _Refused(MarkedYAMLError):
    """Sound YAML that is not used in plans."""


class _CoreResolver(VersionedResolver):
    """The types of `_CORE_SCHEMA`, whatever version a `%YAML` directive asks for."""

    processing_version = (1, 2)
    versioned_resolver: ClassVar = {  # of words with any first character
        None: [
            (f"tag:yaml.org,2002:{n}", re.compile(f"^(?:{p})$")) for n, p in _CORE_SCHEMA.items()
        ]
    }


class _PlainComposer(Composer):
    """Refuses what plans have no use for, and puts long words into their places again."""

    _values = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.parser.peek_event()
        self._values += 1
        problem = ""
        if self._values > _MAX_VALUES:
            problem = f"more than {_MAX_VALUES:,} keys and values, the most of a plan"
        elif isinstance(event, AliasEvent):
            problem = "aliases (*name) are not used in plans"
        elif event.ctag is not None:
            problem = f"tags ({event.ctag}) are not used in plans"
        elif self.depth > _MAX_DEPTH:
            problem = f"nested more than {_MAX_DEPTH} deep"
        if problem:
            raise _Refused(problem=problem, problem_mark=event.start_mark)
        self.anchors.clear()  # one that is named twice is no matter where none is used
        node = super().compose_node(parent, index)
        is_key = isinstance(parent, MappingNode) and index is None
        if isinstance(node, ScalarNode):
            node.value = _words_of(self.loader.long, node.value)
        if is_key and node.tag != _TEXT:
            shown = f", not {node.value}" if isinstance(node, ScalarNode) and node.value else ""
            problem = f"a key has to be a word{shown}"
            raise MarkedYAMLError(problem=problem, problem_mark=node.start_mark)
        return node


_LINES = re.compile(r"([!-~][ -~]*\n){2,}")
"""Text of several lines that stands in a block as it is."""


class _Blocks(SafeRepresenter):
    """Writes text of several lines, as a track, line by line, and long words by short ones."""

    def represent_str(self, data: str) -> Any:
        style = "|" if _LINES.fullmatch(data) else None
        short = _without_words(self.dumper.long, data)
        return self.represent_scalar(_TEXT, short, style=style)


_Blocks.add_representer(str, _Blocks.represent_str)


def _yaml() -> Any:
    """Return what reads and writes; its `long` are the words for which others stand."""
    yaml: Any = YAML(typ="safe", pure=True)
    yaml.long = {}
    yaml.Representer = _Blocks
    yaml.Resolver, yaml.Composer = _CoreResolver, _PlainComposer
    return yaml


def dump_yaml(data: Mapping[str, Any]) -> str:
    """Return `data` as YAML text that `load_yaml` reads back, keys in their order.

    >>> print(dump_yaml({"name": "2:30", "flight": {"start": [0, 1.5]}}), end="")
    name: 2:30
    flight:
      start:
      - 0
      - 1.5
    """
    yaml = _yaml()
    yaml.default_flow_style = yaml.allow_unicode = False
    yaml.sort_base_mapping_type_on_output = False
    yaml.width = _MAX_WIDTH
    text = io.StringIO()
    yaml.dump(data, text)
    return _words_of(yaml.long, text.getvalue())


def shown(text: str) -> str:
    """Return a plan's `text` for people, its long words cut short."""
    return _LONG_WORD.sub(lambda found: shortened(found[0]), text)


def _without_words(long: dict[str, str], text: str) -> str:
    """Return `text` with stand-ins for its long words, which are kept in `long`."""

    def stand_in(found: re.Match[str]) -> str:
        name = f"long-word-{hashlib.sha256(found[0].encode()).hexdigest()}"
        long[name] = found[0]
        return name

    return _LONG_WORD.sub(stand_in, text)


def _words_of(long: dict[str, str], text: str) -> str:
    """Return `text` with its long words in their places again."""
    return _STAND_IN.sub(lambda found: long.get(found[0], found[0]), text) if long else text


def load_yaml(text: str, source: str) -> dict[str, Any]:
    """Return the mapping that `text` holds.

    `source` names the file in messages. Raises `PlanError` with the line for anything that is
    not one YAML mapping.

    >>> load_yaml("{tolerance: 1e-4, antennas: 010, name: no}", "plan.yaml")
    {'tolerance': 0.0001, 'antennas': 10, 'name': 'no'}
    """
    if text.startswith("QGC WPL") or (text.lstrip()[:1] == "{" and '"fileType"' in text):
        raise PlanError(f"{source}: a mission, not a plan; faao-mission validate takes missions")
    yaml = _yaml()
    text = _without_words(yaml.long, text)
    if len(text) > MAX_CHARACTERS:
        raise PlanError(
            f"{source}: {len(text):,} characters; a plan has at most {MAX_CHARACTERS:,}"
        )
    try:
        data = yaml.load(text)
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        what = "" if isinstance(error, _Refused) else "not valid YAML: "
        problem = getattr(error, "problem", None) or " ".join(str(error).split())
        advice = "; indent with spaces" if r"'\t'" in problem else ""
        problem = shortened(problem, _MAX_PROBLEM)
        raise PlanError(f"{source}: {where}{what}{problem}{advice}") from None
    except ValueError:  # beyond the digits that Python converts
        raise PlanError(f"{source}: a whole number of thousands of digits") from None
    if not isinstance(data, dict):
        found = "nothing" if data is None else type(data).__name__
        raise PlanError(
            f"{source}: a plan is a mapping of sections (site, flight, ...), not {found}"
        )
    return data
