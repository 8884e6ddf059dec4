"""Which command an argument list is for."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import FLYABLE
from typer.testing import CliRunner

from faao_mav.autopilot import autopilots, kinds
from faao_mav.cli.main import app

HOME = "0\t1\t0\t16\t0\t0\t0\t0\t47.4\t8.5\t400\t1"
MISSION = f"QGC WPL 110\n{HOME}\n1\t0\t3\t16\t0\t0\t0\t0\t47.5\t8.6\t50\t1\n"


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture(autouse=True)
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plan.yaml").write_text(FLYABLE)
    (tmp_path / "m.waypoints").write_text(MISSION)
    return tmp_path


@pytest.mark.parametrize(
    "arguments",
    [["plan.yaml", "--quiet"], ["--quiet", "plan.yaml"], ["plan", "plan.yaml", "--quiet"]],
)
def test_a_plan_needs_no_command(arguments: list[str], in_folder: Path) -> None:
    result = run(*arguments, "--out", "out.waypoints")
    assert (result.exit_code, result.output) == (0, "")
    assert (in_folder / "out.waypoints").exists()


def test_a_plan_may_have_any_name(in_folder: Path) -> None:
    (in_folder / "valley").write_text(FLYABLE)
    assert run("valley", "--quiet", "--out", "out.waypoints").exit_code == 0
    (in_folder / "convert").write_text(FLYABLE)
    assert run("./convert", "--quiet").exit_code == 0


def test_help_tells_how_to_plan_and_every_command() -> None:
    shown = run("--help").stdout
    assert "faao-mission PLAN.yaml --out MISSION" in shown
    for command in ("validate", "upload", "download", "convert", "autopilot", "study"):
        assert f"\n  {command} " in shown
    assert run("-h").stdout == shown
    assert "--method" in run("plan.yaml", "--help").stdout
    assert "--method" in run("plan", "-h").stdout
    assert run("--version").stdout.startswith("faao-mission ")
    validates = run("validate", "--help").stdout
    assert all(name in validates for name in (*autopilots(), *kinds()))
    bare = run()
    assert (bare.exit_code, "Commands:" in bare.stderr) == (2, True)


def test_help_loads_nothing_that_costs() -> None:
    code = (
        "import sys; from faao_mav.cli.main import app\n"
        "try: app(['--help'])\n"
        "except SystemExit: print(*sys.modules)"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout
    assert "faao_mav.cli.missions" in loaded
    assert not {"numpy", "scipy", "pymavlink", "ruamel", "pydantic"} & set(loaded.split())
