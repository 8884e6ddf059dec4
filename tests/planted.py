"""Modules beside a plan that must not run: whoever imports one of them is told of in a file."""

import sys
from pathlib import Path

_OTHERS = ("faao_mav", "joblib", "numpy", "scipy", "cloudpickle", "nicegui", "uvicorn", "shapely")


def plant(folder: Path) -> Path:
    """Put modules of many names into `folder`; return the file that is there once one has run."""
    ran = folder / "ran"
    for name in (*sorted(sys.stdlib_module_names), *_OTHERS):
        (folder / f"{name}.py").write_text(f"open({str(ran)!r}, 'a').write('{name} ')\n")
    return ran
