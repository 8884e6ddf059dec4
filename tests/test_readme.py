"""What README shows is true."""

import dataclasses
import re
from pathlib import Path

import yaml

from faao_mav.plan import parse_plan

README = (Path(__file__).parent.parent / "README.md").read_text()
REQUIRED = {
    "site": ["origin"],
    "vehicle": ["max_speed", "max_acceleration"],
    "flight": ["start", "end", "altitude", "duration"],
}


def test_the_plan_in_the_readme_shows_the_defaults() -> None:
    found = re.search(r"```yaml\n(.*?)```", README, re.DOTALL)
    assert found is not None
    full = yaml.safe_load(found[1])
    least = {section: {k: full[section][k] for k in keys} for section, keys in REQUIRED.items()}
    stations = ("base_station", "ground_user")
    least["radio"] = {s: {"position": full["radio"][s]["position"]} for s in stations}
    shown, default = parse_plan(found[1]), parse_plan(yaml.safe_dump(least))
    assert dataclasses.replace(shown, text="") == dataclasses.replace(default, text="")
