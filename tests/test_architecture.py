"""Data flows one way: no import runs upward or in a circle, and costly imports wait."""

import ast
import re
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from pages import PAGES, ROOT

import faao_mav

PACKAGE = Path(faao_mav.__file__).parent

FLOOR = {
    room: int(floor)
    for floor, rooms in re.findall(r"^\| (\d+) \| (`.*?`) \|", PAGES["docs/house.md"], re.MULTILINE)
    for room in re.findall(r"`(\w+)`", rooms)
}
"""Rooms from the ground up: none imports from its own floor or one above it, but from itself."""


MODULES = {
    ".".join(("faao_mav", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(
        ".__init__"
    ): path
    for path in PACKAGE.rglob("*.py")
}
"""Every module of the package by its dotted name."""


def imports(path: Path) -> set[str]:
    """Return the package's modules that a file imports, wherever it does, for types as well."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.add(inner if inner in MODULES else node.module)
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {name for name in found if name.startswith("faao_mav.")}


IMPORTS = {name: imports(path) for name, path in MODULES.items()}
BETWEEN = [
    (name, other, name.split(".")[1], other.split(".")[1])
    for name, others in IMPORTS.items()
    if name not in ("faao_mav", "faao_mav.__main__")
    for other in others
]
"""Each module that imports another, with the rooms of both."""


def test_no_import_runs_upward() -> None:
    upward = [each for each in BETWEEN if FLOOR[each[3]] >= FLOOR[each[2]] and each[3] != each[2]]
    assert upward == []


def test_what_knows_missions_and_autopilots_knows_no_radios_or_plans() -> None:
    half = {"mission", "autopilot", "wire", "sim"}
    ground = {"errors", "arrays", "vector", "files", "geodesy", "power", "processes"}
    assert [each for each in BETWEEN if each[2] in half and each[3] not in half | ground] == []


def test_no_module_imports_itself_by_way_of_others() -> None:
    """Not even for types, where Python itself would not mind."""
    try:
        TopologicalSorter(IMPORTS).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_every_public_name_can_be_had_and_the_package_is_a_program() -> None:
    assert faao_mav.__all__ == sorted(faao_mav.__all__)
    assert all(getattr(faao_mav, name).__doc__ for name in faao_mav.__all__)
    assert set(faao_mav.__all__) < set(dir(faao_mav))
    assert set(re.findall(r"`(\w+)`", faao_mav.__doc__ or "")) == set(faao_mav.__all__)
    with pytest.raises(AttributeError):
        getattr(faao_mav, "missing")  # noqa: B009
    command = [sys.executable, "-m", "faao_mav", "--version"]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert told == f"faao-mission {faao_mav.__version__}\n"


WAITING = dict(
    line.split(": ") for line in (ROOT / "tests/data/waiting.txt").read_text().splitlines()[1:]
)


def test_costly_imports_wait() -> None:
    code = (
        "import importlib, sys\n"
        "for name in sys.argv[1:]:\n"
        "    importlib.import_module('faao_mav.' + name)\n"
        "    print(*sys.modules)"
    )
    command = [sys.executable, "-c", code, *WAITING]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    assert len(told) == len(WAITING)
    loaded = {
        name: set(absent.split()) & set(line.split())
        for (name, absent), line in zip(WAITING.items(), told, strict=True)
    }
    assert loaded == {name: set() for name in loaded}
