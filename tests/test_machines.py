"""One plan: the same bytes on one machine, the same optimum on another."""

from pathlib import Path
from typing import Any

import pytest
from conftest import FLYABLE, edited
from processors import NARROW, SAME_RATE, planned


@pytest.fixture(params=["direct", pytest.param("algorithm1", marks=pytest.mark.slow)])
def plan_file(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    of_each: dict[str, dict[str, Any]] = {
        "direct": {"radio.fading": "ergodic", "radio.fading_samples": 8, "radio.causal": True},
        "algorithm1": {"radio.fading": "realization", "optimizer.method": "algorithm1"},
    }
    path = tmp_path / "plan.yaml"
    path.write_text(edited(FLYABLE, of_each[request.param]))
    return path


@pytest.mark.figures
def test_a_plan_has_the_same_optimum_on_another_machine(plan_file: Path) -> None:
    """The other one is this machine, without the wide kernels of NumPy and OpenBLAS."""
    here, rate = planned(plan_file, {})
    assert planned(plan_file, {}) == (here, rate)
    _, its_rate = planned(plan_file, NARROW)
    assert its_rate == pytest.approx(rate, rel=SAME_RATE, abs=0)
