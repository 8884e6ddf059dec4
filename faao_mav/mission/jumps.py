"""Where the jumps of a mission go: to an item by its number (DO_JUMP), or by its tag."""

import math
from collections.abc import Sequence
from typing import Final

from faao_mav.mission.command import Command
from faao_mav.mission.item import MissionItem

JUMPS: Final = (Command.DO_JUMP, Command.DO_JUMP_TAG)
"""The commands that repeat what stands between their target and them, param2 times."""


def jump_target(items: Sequence[MissionItem], index: int) -> int | None:
    """Return the index that the jump at `index` goes to, None if there is no such item.

    The target of a DO_JUMP counts items from 1; that of a DO_JUMP_TAG is the first JUMP_TAG with
    its number.

    >>> tag, jump = MissionItem(600, 2, (7.0, 0, 0, 0)), MissionItem(601, 2, (7.0, 2.0, 0, 0))
    >>> jump_target([tag, jump], 1), jump_target([jump], 0)
    (0, None)
    """
    item = items[index]
    number = item.params[0]
    if math.isnan(number):
        return None
    if item.command == Command.DO_JUMP:
        return int(number) - 1 if 1 <= int(number) <= len(items) else None
    tags = (
        k
        for k, each in enumerate(items)
        if each.command == Command.JUMP_TAG and each.params[0] == number
    )
    return next(tags, None)
