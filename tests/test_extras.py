"""What the package requires is enough for all but its extras, which say how to be installed."""

import re
import subprocess
import sys
from importlib.metadata import packages_distributions, requires
from pathlib import Path

import pytest
from conftest import FLYABLE
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

_PROGRAM = """import sys
sys.modules.update(dict.fromkeys({}))  # these can neither be imported nor found
from faao_mav.cli.main import run
run()"""


def required() -> set[str]:
    """Return the distributions that come with `pip install faao-mav`, without any extra."""
    found, pending = set[str](), [("faao-mav", "")]
    while pending:
        name, extra = pending.pop()
        found.add(canonicalize_name(name))
        for each in map(Requirement, requires(name) or ()):
            if each.marker is None or each.marker.evaluate({"extra": extra}):
                more = [(each.name, asked) for asked in ("", *each.extras)]
                pending += [one for one in more if canonicalize_name(one[0]) not in found]
    return found


def without_extras(folder: Path, *arguments: object) -> "subprocess.CompletedProcess[str]":
    """Run the command as if nothing that only an extra brings were installed."""
    kept = required()
    absent = [
        module
        for module, owners in packages_distributions().items()
        if not kept & {canonicalize_name(owner) for owner in owners}
    ]
    command = [sys.executable, "-c", _PROGRAM.format(absent), *map(str, arguments)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_a_plan_needs_no_extra(tmp_path: Path) -> None:
    (tmp_path / "plan.yaml").write_text(FLYABLE)
    done = without_extras(tmp_path, "plan.yaml", "--out", "m.plan", "--report", "r.html", "--quiet")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("extra", "arguments"),
    [
        ("app", "app plan.yaml --no-browser"),
        ("app", "app --no-browser"),
        ("debrief", "debrief flight.ulg --plan plan.yaml"),
        ("maps", "link --terrain dem.tif --frequency 900 --station 1,2,3"),
        ("cluster", "study plan.yaml --cluster tcp://127.0.0.1:9 --out rows"),
    ],
)
def test_a_missing_extra_is_named_in_one_line(extra: str, arguments: str, tmp_path: Path) -> None:
    (tmp_path / "plan.yaml").write_text(FLYABLE)
    (tmp_path / "flight.ulg").write_bytes(b"ULog")
    (tmp_path / "dem.tif").write_bytes(b"II*")
    done = without_extras(tmp_path, *arguments.split())
    said = rf"faao-mission: [^\n]* needs \w+, which is not installed: pip install '\.\[{extra}\]'"
    assert re.fullmatch(rf"{said} in a checkout of faao-mav\n", done.stderr), done.stderr
    assert (done.returncode, done.stdout) == (2, "")
    assert not (tmp_path / "rows").exists()
