"""What README shows is true."""

import dataclasses
import re
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from faao_mav.cli.main import app
from faao_mav.plan import parse_plan
from faao_mav.plan.yaml_text import dump_yaml, load_yaml

README = (Path(__file__).parent.parent / "README.md").read_text()
REQUIRED = {
    "site": ["origin"],
    "vehicle": ["max_speed", "max_acceleration"],
    "flight": ["start", "end", "altitude", "duration"],
}


def test_the_plan_in_the_readme_shows_the_defaults() -> None:
    found = re.search(r"```yaml\n(.*?)```", README, re.DOTALL)
    assert found is not None
    full = load_yaml(found[1], "test")
    least = {section: {k: full[section][k] for k in keys} for section, keys in REQUIRED.items()}
    stations = ("base_station", "ground_user")
    least["radio"] = {s: {"position": full["radio"][s]["position"]} for s in stations}
    shown, default = parse_plan(found[1]), parse_plan(dump_yaml(least))
    assert dataclasses.replace(shown, text="") == dataclasses.replace(default, text="")


def test_the_conversion_in_the_readme_says_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    source = Path(__file__).parent / "data" / "missions" / "fence_and_rally.plan"
    shutil.copy(source, tmp_path / "site.plan")
    found = re.search(r"\$ faao-mission (convert .*)\n((?:.*\n)*?)```", README)
    assert found is not None
    result = CliRunner().invoke(app, found[1].split())
    assert result.stderr + result.stdout == found[2]
