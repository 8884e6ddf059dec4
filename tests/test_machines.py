"""One plan: the same bytes on one machine, the same optimum on another."""

from pathlib import Path

import pytest
from conftest import FLYABLE, edited
from processors import NARROW, SAME_RATE, planned


@pytest.mark.figures
def test_a_plan_has_the_same_optimum_on_another_machine(tmp_path: Path) -> None:
    """The other one is this machine, without the wide kernels of NumPy and OpenBLAS."""
    drawn = {"radio.fading": "ergodic", "radio.fading_samples": 8, "radio.causal": True}
    plan_file = tmp_path / "plan.yaml"
    plan_file.write_text(edited(FLYABLE, drawn))
    here, rate = planned(plan_file, {})
    assert planned(plan_file, {}) == (here, rate)
    _, its_rate = planned(plan_file, NARROW)
    assert its_rate == pytest.approx(rate, rel=SAME_RATE, abs=0)
