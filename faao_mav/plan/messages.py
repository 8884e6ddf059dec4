"""What pydantic found wrong, as lines that name key, value and what is accepted."""

import difflib
from collections.abc import Iterator, Sequence
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

MAX_LINES = 6
_MAX_SHOWN = 60


def describe(error: ValidationError, schema: type[BaseModel], source: str) -> str:
    """Return one line per finding (at most `MAX_LINES`), each naming `source`."""
    lines = list(dict.fromkeys(_lines(error, schema)))
    more = len(lines) - MAX_LINES
    if more > 0:
        lines = [*lines[:MAX_LINES], f"and {more} more"]
    return "\n".join(f"{source}: {line}" for line in lines)


def quote(value: object) -> str:
    """Return `value` as it may be shown in one line."""
    if isinstance(value, dict | list) and not value:
        return "nothing"
    text = "null" if value is None else repr(value)
    return text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 3] + "..."


def _lines(error: ValidationError, schema: type[BaseModel]) -> Iterator[str]:
    for detail in error.errors(include_url=False):
        path, models, description = _walk(detail["loc"], schema)
        yield f"{path}: {_problem(detail, models, description, schema)}"


def _problem(
    detail: ErrorDetails,
    model: type[BaseModel] | None,
    description: str,
    schema: type[BaseModel],
) -> str:
    kind, value = detail["type"], detail["input"]
    if kind == "missing":
        return f"missing; give {description}"
    if kind == "extra_forbidden":
        return f"unknown key; {_nearest(str(detail['loc'][-1]), model, schema)}"
    if kind == "value_error":
        reason = str(detail["ctx"]["error"])
        return f"{quote(value)}: {reason}; give {description}"
    if kind == "finite_number":
        return f"{value} is not a finite number; give {description}"
    return f"{quote(value)} is not accepted; give {description}"


def _nearest(key: str, model: type[BaseModel] | None, schema: type[BaseModel]) -> str:
    known = sorted(model.model_fields) if model else []
    close = difflib.get_close_matches(key, known, n=1, cutoff=0.6)
    if close:
        return f"did you mean {close[0]}?"
    elsewhere = [path for path in paths(schema) if path.rsplit(".", 1)[-1] == key]
    if elsewhere:
        return f"it belongs at {' or '.join(elsewhere)}"
    return f"known here: {', '.join(known)}"


def paths(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Every key path below `model`."""
    for name, field in model.model_fields.items():
        yield prefix + name
        for child in _models(field.annotation):
            yield from paths(child, f"{prefix}{name}.")


def _walk(
    location: Sequence[int | str], schema: type[BaseModel]
) -> tuple[str, type[BaseModel] | None, str]:
    """Follow `location` through the schema.

    Returns the key path as people write it, the model that holds the last key, and what that
    key accepts.
    """
    path = ""
    candidates: list[type[BaseModel]] = [schema]
    holder: type[BaseModel] | None = None
    description = "a mapping"
    for step in location:
        if isinstance(step, int):
            path += f"[{step}]"
            continue
        named = next((m for m in candidates if m.__name__ == step), None)
        if named is not None:  # the name of a union's member, not a key
            candidates = [named]
            continue
        path += f".{step}" if path else str(step)
        holder = candidates[0] if candidates else None
        field = holder.model_fields.get(step) if holder else None
        if field is None:
            candidates = []
            continue
        candidates = list(_models(field.annotation))
        description = field.description or _keys(candidates)
    return path or "plan", holder, description


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    elif get_origin(annotation) in (Union, UnionType, list, Annotated):
        for part in get_args(annotation):
            yield from _models(part)


def _keys(models: Sequence[type[BaseModel]]) -> str:
    if not models:
        return "another value"
    return " or ".join(f"a mapping with {', '.join(m.model_fields)}" for m in models)
