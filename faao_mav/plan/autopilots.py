"""The vehicle that a plan names: `vehicle.autopilot`, `vehicle.type` and `vehicle.body`.

The names that are accepted are those of the vehicles that `faao_mav.autopilot` knows.
"""

from dataclasses import asdict, fields
from typing import Annotated, Any, TypeAlias

from pydantic import TypeAdapter, ValidationInfo

from faao_mav.autopilot import Autopilot, Kind, autopilots, kinds, vehicle_type
from faao_mav.autopilot.body import Body, CopterBody, PlaneBody
from faao_mav.errors import InputError
from faao_mav.plan.fields import Written, listed, one_of, told

AutopilotName: TypeAlias = Annotated[
    Autopilot, one_of(autopilots), Written(lambda: listed(autopilots()))
]
KindName: TypeAlias = Annotated[Kind, one_of(kinds), Written(lambda: listed(kinds()))]


def body_of(value: object, info: ValidationInfo) -> Body | None:
    """Return `vehicle.body` of a plan: numbers over those of the simulator; None where all are."""
    try:
        known = vehicle_type(info.data.get("autopilot", ""), info.data.get("type", ""))
    except InputError:  # an unknown name is told by itself
        return None
    if value in (None, "sitl"):
        return None
    if not isinstance(value, dict):
        raise ValueError("neither sitl nor a mapping")
    if known.body is None:
        raise told(f"no flight model of {known.family.key} {known.kind} reads it; give sitl")
    own: dict[str, Any] = asdict(known.body)
    if foreign := [name for name in value if name in _NUMBERS and name not in own]:
        raise told(
            f"{foreign[0]} is not of a {known.kind}'s body, which has {listed([*own], 'and')}"
        )
    body = TypeAdapter(type(known.body)).validate_python({**own, **value})
    return body if body != known.body else None


_NUMBERS = {each.name for body in (CopterBody, PlaneBody) for each in fields(body)}
"""The names of all numbers of all airframes."""
