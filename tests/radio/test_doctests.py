import doctest
import importlib
import pkgutil

import pytest

import faao_mav.radio

MODULES = [module.name for module in pkgutil.iter_modules(faao_mav.radio.__path__)]


@pytest.mark.parametrize("name", MODULES)
def test_examples_in_docstrings(name: str) -> None:
    module = importlib.import_module(f"faao_mav.radio.{name}")
    assert doctest.testmod(module).failed == 0
