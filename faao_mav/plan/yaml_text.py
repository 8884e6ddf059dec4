"""YAML text to plain Python data, without the surprises of YAML 1.1.

PyYAML's own resolver reads `1e-4` as text, `2:30` as 150, `010` as 8 and `no` as false, and
keeps the last of two equal keys. A plan that drives an aircraft is read by the core schema of
YAML 1.2 instead, and a key that stands twice is an error.
"""

import re
from typing import Any

import yaml

from faao_mav.errors import PlanError

MAX_CHARACTERS = 1_000_000
_MAX_DEPTH = 20


class _Loader(yaml.SafeLoader):
    def construct_unique_mapping(self, node: yaml.MappingNode) -> dict[Any, Any]:
        seen = set()
        for key_node, _ in node.value:
            if not isinstance(key_node, yaml.ScalarNode) or not key_node.tag.endswith(":str"):
                shown = f", not {key_node.value}" if isinstance(key_node.value, str) else ""
                raise yaml.MarkedYAMLError(
                    problem=f"a key has to be a word{shown}", problem_mark=key_node.start_mark
                )
            if key_node.value in seen:
                raise yaml.MarkedYAMLError(
                    problem=f"the key '{key_node.value}' stands twice",
                    problem_mark=key_node.start_mark,
                )
            seen.add(key_node.value)
        return self.construct_mapping(node, deep=True)

    def construct_decimal(self, node: yaml.ScalarNode) -> int:
        try:
            return int(node.value)
        except ValueError:  # beyond the digits that Python converts
            raise yaml.MarkedYAMLError(
                problem="a whole number of thousands of digits", problem_mark=node.start_mark
            ) from None


_Loader.yaml_implicit_resolvers = {}
for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", "~nN\0"),
    ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
    ("int", r"[-+]?[0-9]+", "-+0123456789"),
    (
        "float",
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
        r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        "-+.0123456789",
    ),
):
    _Loader.add_implicit_resolver(
        f"tag:yaml.org,2002:{_tag}",
        re.compile(rf"^(?:{_pattern})$"),
        [c if c != "\0" else "" for c in _first],
    )
_Loader.add_constructor("tag:yaml.org,2002:map", _Loader.construct_unique_mapping)
_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_decimal)


def _check_structure(text: str, source: str) -> None:
    """Refuse what is read recursively or by reference before it is built."""
    depth, problem = 0, ""
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if isinstance(event, yaml.AliasEvent):
            problem = "aliases (*name) are not used in plans"
        elif depth > _MAX_DEPTH:
            problem = f"nested more than {_MAX_DEPTH} deep"
        if problem:
            line = event.start_mark.line + 1 if event.start_mark else "?"
            raise PlanError(f"{source}: line {line}: {problem}")


def load_yaml(text: str, source: str) -> dict[Any, Any]:
    """Return the mapping that `text` holds.

    `source` names the file in messages. Raises `PlanError` with the line for anything that is
    not one YAML mapping.
    """
    if text.startswith("QGC WPL") or (text.lstrip()[:1] == "{" and '"fileType"' in text):
        raise PlanError(f"{source}: a mission, not a plan; faao-mission validate takes missions")
    if len(text) > MAX_CHARACTERS:
        raise PlanError(
            f"{source}: {len(text):,} characters; a plan has at most {MAX_CHARACTERS:,}"
        )
    try:
        _check_structure(text, source)
        data = yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        advice = "; indent with spaces" if r"'\t'" in (error.problem or "") else ""
        raise PlanError(f"{source}: {where}not valid YAML: {error.problem}{advice}") from None
    except (yaml.YAMLError, ValueError) as error:
        problem = " ".join(str(error).split())
        raise PlanError(f"{source}: not valid YAML: {problem}") from None
    if not isinstance(data, dict):
        found = "nothing" if data is None else type(data).__name__
        raise PlanError(
            f"{source}: a plan is a mapping of sections (site, flight, ...), not {found}"
        )
    return data
