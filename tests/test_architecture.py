"""Data flows one way: no import runs upward, and costly imports wait until they are needed."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import faao_mav

PACKAGE = Path(faao_mav.__file__).parent

FLOORS = (
    ("errors", "arrays"),
    ("vector", "files", "geodesy"),
    ("radio", "plan"),
    ("optimizer",),
    ("mission",),
    ("vehicle",),
    ("schedule",),
    ("validate",),
    ("mavlink",),
    ("workflow",),
    ("report",),
    ("study",),
    ("cli",),
)
"""Rooms from the ground up: none imports from its own floor or one above it, but from itself."""

FLOOR = {room: level for level, rooms in enumerate(FLOORS) for room in rooms}


def room_of(module: str) -> str:
    return module.split(".")[1]


def imports(path: Path) -> set[str]:
    """Every module of the package that the file imports, wherever it does."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {name for name in found if name.startswith("faao_mav.")}


def test_no_import_runs_upward() -> None:
    upward = []
    for path in PACKAGE.rglob("*.py"):
        own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        if own == "__init__":
            continue
        for module in imports(path):
            other = room_of(module)
            if other != own and FLOOR[other] >= FLOOR[own]:
                upward.append((path.name, module))
    assert upward == []


def test_every_public_name_can_be_had() -> None:
    assert faao_mav.__all__ == sorted(faao_mav.__all__)
    assert all(getattr(faao_mav, name).__doc__ for name in faao_mav.__all__)
    with pytest.raises(AttributeError):
        faao_mav.missing  # noqa: B018


def test_public_names_are_typed_where_they_are() -> None:
    typed = {
        alias.asname: node.module
        for node in ast.walk(ast.parse((PACKAGE / "__init__.py").read_text()))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("faao_mav")
        for alias in node.names
    }
    assert typed == {name: f"faao_mav.{home}" for name, home in faao_mav._HOME.items()}


@pytest.mark.parametrize(
    ("statement", "absent"),
    [
        ("import faao_mav.cli.main", {"numpy", "cvxpy", "pyproj", "pydantic", "rich.progress"}),
        ("import faao_mav.plan", {"scipy", "cvxpy", "pyproj", "pymavlink"}),
        ("import faao_mav.radio.mutual_information, faao_mav.radio.precoder", {"scipy", "cvxpy"}),
        ("import faao_mav.validate", {"scipy", "cvxpy", "pyproj", "pymavlink", "shapely"}),
        ("import faao_mav.cli.validate", {"numpy", "pyproj", "pydantic", "rich.table", "shapely"}),
        ("import faao_mav.mavlink.client", {"scipy", "pyproj", "pymavlink.mavutil", "serial"}),
        ("import faao_mav.cli.upload, faao_mav.cli.download", {"numpy", "pymavlink"}),
        ("import faao_mav.cli.autopilot", {"numpy", "pymavlink"}),
        ("import faao_mav.cli.study", {"numpy", "joblib", "matplotlib"}),
        ("import faao_mav.study", {"scipy", "cvxpy", "joblib", "matplotlib", "pyproj"}),
        ("import faao_mav.report", {"scipy", "cvxpy", "matplotlib"}),
        ("import faao_mav.mission.formats", {"scipy", "cvxpy", "pyproj", "pymavlink", "pydantic"}),
    ],
)  # fmt: skip
def test_costly_imports_wait(statement: str, absent: set[str]) -> None:
    code = f"{statement}; import sys; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert absent & set(run.stdout.split()) == set()
