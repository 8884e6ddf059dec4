"""`plan.yaml` -> `Plan`."""

from dataclasses import fields
from functools import cache
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from faao_mav.errors import PlanError
from faao_mav.files import read_text
from faao_mav.plan.checks import problems
from faao_mav.plan.messages import describe
from faao_mav.plan.model import Plan, PlanFile
from faao_mav.plan.yaml_text import MAX_CHARACTERS, dump_yaml, load_yaml


def read_plan(path: str | Path, *, method: str | None = None) -> Plan:
    """Read and validate the plan in the file `path`.

    `method`, where given, replaces `optimizer.method`. Raises `PlanError` that names the file,
    the key, the value and what would be accepted.

    >>> plan = read_plan("missions/copter_relay.yaml")
    >>> plan.flight.start, plan.flight.duration, plan.radio.modulation
    ((0.0, 350.0), 120.0, 'qpsk')
    """
    text = read_text(path, 4 * MAX_CHARACTERS, "a plan", PlanError).removeprefix("\ufeff")
    return parse_plan(text, str(path), method=method)


def parse_plan(text: str, source: str = "plan", *, method: str | None = None) -> Plan:
    """Validate the plan in `text`; `source` names it in messages. See `read_plan`."""
    data = load_yaml(text, source)
    if method is not None:
        section = data.setdefault("optimizer", {})
        if isinstance(section, dict):
            section["method"] = method
        text = dump_yaml(data)
    try:
        contents = _adapter().validate_python(data, context={})
    except ValidationError as error:
        raise PlanError(describe(error, source)) from None
    held = {field.name: getattr(contents, field.name) for field in fields(contents)}
    plan = Plan(**held, text=text, source=source)
    for problem in problems(plan):
        raise PlanError(f"{source}: {problem}")
    return plan


@cache
def _adapter() -> TypeAdapter[PlanFile]:
    return TypeAdapter(PlanFile)
