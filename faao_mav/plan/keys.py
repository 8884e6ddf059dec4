"""The dotted keys of a plan, as a study varies them."""

import difflib
from collections.abc import Iterable

from faao_mav.plan.messages import paths
from faao_mav.plan.schema import PlanSection

POWER = "power_dbm"
"""The powers of the base station and of the relay together."""

ALIASES = {POWER: ("radio.base_station.power_dbm", "radio.relay.power_dbm")}
"""Keys of a study that stand for several of the plan."""

_FREE = "vehicle.parameters."  # any name below it
_NOT_VARIED = ("study", "name")


def varied_twice(keys: Iterable[str]) -> str:
    """Return two of `keys`, joined, that stand for the same value of a plan; nothing if none do."""
    varied: dict[str, str] = {}
    for key in keys:
        for path in ALIASES.get(key, (key,)):
            if path in varied:
                return key if varied[path] == key else f"{varied[path]} and {key}"
            varied[path] = key
    return ""


def unknown_key(key: str) -> str:
    """Return why `key` cannot be varied and what is near it; nothing for a key that can."""
    every = [path for path in paths(PlanSection) if path.split(".")[0] not in _NOT_VARIED]
    sections = {path.rsplit(".", 1)[0] for path in every if "." in path}
    known = [*ALIASES, *(path for path in every if path not in sections)]
    if key in known or (key.startswith(_FREE) and key != _FREE):
        return ""
    if key in sections:
        inside = [path for path in known if path.startswith(f"{key}.")]
        return f"a section cannot be varied; give one of {', '.join(inside)}"
    close = difflib.get_close_matches(key, known, n=1, cutoff=0.6)
    same = [path for path in known if path.rsplit(".", 1)[-1] == key.rsplit(".", 1)[-1]]
    if same or close:
        return f"unknown key; did you mean {' or '.join(same or close)}?"
    return "unknown key; give a dotted key of the plan, as radio.modulation"
