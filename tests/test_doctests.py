"""The examples in docstrings run, room by room."""

import doctest
import pkgutil
from importlib import import_module
from pathlib import Path

import pytest

import faao_mav

ROOMS = sorted(module.name for module in pkgutil.iter_modules(faao_mav.__path__))


@pytest.mark.parametrize("room", ROOMS)
@pytest.mark.usefixtures("planned_once", "coarse_map")
def test_examples_in_docstrings(room: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(Path(__file__).parents[1])  # examples read missions/
    first = import_module(f"faao_mav.{room}")
    inside = pkgutil.walk_packages(getattr(first, "__path__", []), f"{first.__name__}.")
    for module in (first, *(import_module(found.name) for found in inside)):
        assert doctest.testmod(module).failed == 0, module.__name__
