"""What README and the pages of docs/ show is true, and the site builds without a warning."""

import contextlib
import html
import io
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import PATIENCE, contents, free_port
from pages import PAGES, ROOT, blocks, difference
from typer.testing import CliRunner

import faao_mav
from faao_mav.cli.main import app
from faao_mav.plan import parse_plan, read_plan, reference

COMMAND = Path(sys.executable).with_name("faao-mission")
pytestmark = pytest.mark.usefixtures("planned_once")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to run commands in, with what a checkout has."""
    for name in ("missions", "tests", "docs"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@contextlib.contextmanager
def running(command: str) -> Iterator[None]:
    """Run a command that lasts, from its first line of output on."""
    arguments = [str(COMMAND), *shlex.split(command)[1:]]
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        assert process.stdout is not None
        process.stdout.readline()
        yield
    finally:
        process.terminate()
        process.communicate(timeout=PATIENCE)


def output_of(command: str) -> str:
    """Run a command and return what it prints."""
    if command.startswith("faao-mission "):
        result = CliRunner().invoke(app, shlex.split(command)[1:])
        assert result.exception is None or isinstance(result.exception, SystemExit)
        return result.output
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.figures
@pytest.mark.parametrize(
    "page", [page for page in PAGES if {b.kind for b in blocks(page)} & {"console", "python"}]
)
def test_what_a_page_shows_is_printed(page: str, folder: Path) -> None:
    port = f"127.0.0.1:{free_port()}"
    names: dict[str, object] = {}
    found = [replace(b, text=b.text.replace("127.0.0.1:14550", port)) for b in blocks(page)]
    with contextlib.ExitStack() as lasting:
        for block, following in zip(found, [*found[1:], None], strict=True):
            if not block.run:
                continue
            for command, shown in block.commands:
                if command.endswith(" &"):
                    listen = f" --listen udpin:{port}"
                    lasting.enter_context(running(command.removesuffix(" &") + listen))
                else:
                    assert difference(shown, output_of(command)) is None, command
            if block.kind == "python":
                with contextlib.redirect_stdout(io.StringIO()) as printed:
                    exec(block.text, names)
                if following is not None and following.kind == "text":
                    assert difference(following.text, printed.getvalue()) is None


AS_SHOWN = """
rate 2.2572 bit | rate  2.2550 bit | rate 2.2540 bit
20 m/s | 20 m/s | 21 m/s
predicted in 120.0 s (-0.0 s) | predicted in 120.2 s (+0.1 s) | predicted in 121.0 s (-0.0 s)
2.694 +- 0.002, 2.685 delivered | 2.690 +- 0.001, 2.680 delivered | 2.684 +- 0.002, 2.685 delivered
0.6772 +- 0.0079 | 0.6772 +- 0.0079 | 0.6800 +- 0.0079
-35.360107347 149.1652 | -35.360101234 149.1652 | -35.360207347 149.1652
after 8 iterations, took 0.5 s: | after 1 iteration, took 12.5 s: | after 8 iterations, took 0.5 m:
a#...#c | a#b#b#c | a#b#b
a#b | a#b | a
"""
"""What is shown, what counts as that, and what does not; # ends a line."""


def test_when_a_text_is_as_shown() -> None:
    for row in AS_SHOWN.strip().splitlines():
        shown, same, other = row.replace("#", "\n").split(" | ")
        assert difference(shown, same) is None, row
        assert difference(shown, other) is not None, row


def test_commands_that_are_not_run_have_options_that_exist() -> None:
    commands = [str(command.name) for command in app.registered_commands]
    known = {c: CliRunner().invoke(app, [c, "--help"]).stdout for c in commands}
    wrong = []
    for page in PAGES:
        for block in blocks(page):
            for line in block.text.splitlines() if block.kind in ("sh", "console") else ():
                for arguments in re.findall(r"faao-mission ([^&]*)", line):
                    words = arguments.split()
                    shown = known[words[0] if words[0] in commands else "plan"]
                    options = [word for word in words if word.startswith("--")]
                    wrong += [(page, line) for option in options if f" {option} " not in shown]
                    files = [word for word in words if word.startswith(("missions/", "tests/"))]
                    wrong += [(page, line) for name in files if not (ROOT / name).exists()]
    assert wrong == []


def test_what_pages_name_and_link_to_exists_and_the_readme_is_short() -> None:
    assert 700 <= len(PAGES["README.md"].split()) <= 900
    rooms = r"`((?:faao_mav|tests|missions|docs)/[\w./-]*|\.ci/run)`"
    for page, text in PAGES.items():
        named = [ROOT / name for name in re.findall(rooms, text)]
        links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text)
        named += [(ROOT / page).parent / target for target in links]
        assert [path for path in named if not path.exists()] == [], page
        assert re.findall(r"^(?!\|).*\n(\|.*)\n(?!\|-)", text, re.M) == [], page


def test_the_plan_that_is_shown_has_every_default() -> None:
    plans = [parse_plan(block.text) for block in blocks("docs/plan.md") if block.kind == "yaml"]
    shortest, full = map(contents, plans)
    assert shortest == full


@pytest.mark.figures
@pytest.mark.parametrize(
    "row",
    [
        pytest.param(row, marks=[pytest.mark.slow] if float(row.split()[-2]) > 3 else [])
        for row in re.findall(r"^\| `(missions/.*) \|$", PAGES["README.md"], re.M)
    ],
)
def test_the_sample_plans_have_the_rates_of_the_table(row: str) -> None:
    name, _, start, best, _ = re.split(r" *\| ", row)
    plan = read_plan(ROOT / name.split("`")[0])
    if "--method direct" in name:
        plan = plan.changed({"optimizer.method": "direct"})
    solution = faao_mav.optimize(plan)
    reached = f"{solution.history[0]:.4f} {solution.history[-1]:.4f}"
    assert difference(f"{start} {best.split()[0]}", reached) is None


def test_the_keys_of_json_and_save_are_listed(folder: Path) -> None:
    run = "missions/paper_active.yaml --method direct --save flight.npz --json"
    done = CliRunner().invoke(app, run.split())
    first = re.findall(r"^(?:\| |- )(`.*?)(?: \||: )", PAGES["docs/commands.md"], re.M | re.S)
    listed = set(re.findall(r"`(\w+)`", " ".join(first)))
    with np.load(folder / "flight.npz") as archive:
        assert sorted({*json.loads(done.stdout), *archive} - listed) == []


LEFT = {
    "own_parts": {"route-adaptive.svg", "route-equal-power.svg", "route-of-the-alphabet.svg"},
    "paper_figures": {"paper_fig3.svg", "paper_fig4.svg"},
    "plan_fly_debrief": {"flight.html", "flight.tlog", "mission.param", "mission.waypoints"},
}
"""What the scripts of docs/examples that the site shows leave."""


@pytest.mark.slow
@pytest.mark.parametrize("name", LEFT)
def test_an_example_runs(name: str, tmp_path: Path) -> None:
    command: list[str | Path] = [
        sys.executable,
        ROOT / "docs" / "examples" / f"{name}.py",
        ROOT / "missions",
    ]
    subprocess.run(command, cwd=tmp_path, timeout=PATIENCE, check=True)
    assert {path.name for path in tmp_path.iterdir()} == LEFT[name]


def test_the_site_builds_without_a_warning_and_fetches_nothing(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", tmp_path / "site"],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    shown = (tmp_path / "site" / "reference.html").read_text()
    assert all(f'id="faao_mav.{name}"' in shown for name in faao_mav.__all__)
    reference_page = html.unescape((tmp_path / "site" / "plan.html").read_text())
    assert "generated:" not in reference_page
    lost = [key.path for key in reference().values() if key.accepted not in reference_page]
    assert [path for path in lost if not reference()[path].inside] == []
    for page in (tmp_path / "site").rglob("*.html"):
        fetched = re.findall(r'(?:src|<link[^>]* href)="(https?://[^"]*)"', page.read_text())
        assert fetched == [], page
