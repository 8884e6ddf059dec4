"""Records of arrays whose last two axes are flights and slots: to choose among the flights.

What belongs to a flight as a whole has one slot: (..., flights, 1).
"""

from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from faao_mav.arrays import Flags

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Record = TypeVar("Record", bound="DataclassInstance")


def only(record: Record, flights: Flags) -> Record:
    """Return `record` with those of its flights that `flights` (flights,) marks."""
    return _each(lambda array: array[..., flights, :], record)


def merged(taken: Flags, new: Record, old: Record) -> Record:
    """Return `new` for the flights that `taken` (flights, 1) marks and `old` for the others."""
    if taken.all():
        return new
    return _each(lambda fresh, kept: np.where(taken, fresh, kept), new, old)


def _each(change: Callable[..., Any], first: Record, *others: Record) -> Record:
    """Apply `change` to every array of like records, and to those of the records in them."""
    changed = {}
    for field in fields(first):
        parts = [getattr(record, field.name) for record in (first, *others)]
        if isinstance(parts[0], np.ndarray):
            changed[field.name] = change(*parts)
        elif is_dataclass(parts[0]):
            changed[field.name] = _each(change, *parts)
    return replace(first, **changed)
