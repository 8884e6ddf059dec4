"""What the package requires is enough for all but its extras, which say how to be installed."""

import re
import subprocess
import sys
from ast import literal_eval
from importlib.metadata import packages_distributions, requires
from pathlib import Path

from conftest import FLYABLE
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

_PROGRAM = """import shlex, sys
sys.modules.update(dict.fromkeys({}))  # these can neither be imported nor found
from typer.testing import CliRunner
from faao_mav.cli.main import app
for line in sys.stdin:
    done = CliRunner().invoke(app, shlex.split(line))
    print((done.exit_code, done.stdout, done.stderr))"""

MISSING = {
    "app plan.yaml --no-browser": "app",
    "debrief flight.ulg --plan plan.yaml": "debrief",
    "link --terrain dem.tif --frequency 900 --station 1,2,3": "maps",
    "study plan.yaml --cluster tcp://127.0.0.1:9 --out rows": "cluster",
}
"""Commands, and the extra that each needs."""


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


def test_a_plan_needs_no_extra_and_one_that_is_missing_is_named_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "plan.yaml").write_text(FLYABLE)
    (tmp_path / "flight.ulg").write_bytes(b"ULog")
    (tmp_path / "dem.tif").write_bytes(b"II*")
    kept = required()
    absent = [
        module
        for module, owners in packages_distributions().items()
        if not kept & {canonicalize_name(owner) for owner in owners}
    ]
    commands = ["plan.yaml --out m.plan --report r.html --quiet", *MISSING]
    ran = subprocess.run(
        [sys.executable, "-c", _PROGRAM.format(absent)], input="\n".join(commands), text=True,
        cwd=tmp_path, capture_output=True, check=True,
    )  # fmt: skip
    whole, *rest = map(literal_eval, ran.stdout.splitlines())
    assert whole == (0, "", "")
    assert (tmp_path / "m.plan").exists()
    for (status, told, error), extra in zip(rest, MISSING.values(), strict=True):
        said = r"faao-mission: [^\n]* needs \w+, which is not installed: "
        said += rf"pip install '\.\[{extra}\]' in a checkout of faao-mav\n"
        assert re.fullmatch(said, error), error
        assert (status, told) == (2, "")
    assert not (tmp_path / "rows").exists()
