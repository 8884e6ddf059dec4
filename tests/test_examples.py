"""The scripts of docs/examples that the site shows: they run, and leave what they say."""

import subprocess
import sys
from pathlib import Path

import pytest
from conftest import MISSIONS, PATIENCE
from pages import ROOT

LEFT = {
    "own_parts": {"route-adaptive.svg", "route-equal-power.svg", "route-of-the-alphabet.svg"},
    "paper_figures": {"paper_fig3.svg", "paper_fig4.svg"},
    "plan_fly_debrief": {"flight.html", "flight.tlog", "mission.param", "mission.waypoints"},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LEFT)
def test_an_example_runs(name: str, tmp_path: Path) -> None:
    script = ROOT / "docs" / "examples" / f"{name}.py"
    command: list[str | Path] = [sys.executable, script, MISSIONS]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert done.returncode == 0, done.stderr
    assert {path.name for path in tmp_path.iterdir()} == LEFT[name]
