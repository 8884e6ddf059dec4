"""The radio as it is in a plan: the law of the gain, from the plan or from a file beside it."""

from pathlib import Path
from typing import Any

import pytest
from conftest import SMALL, MakePlan, edited

from faao_mav.errors import PlanError
from faao_mav.optimizer.optimize import optimize
from faao_mav.plan import parse_plan, read_plan

LINK = """
# fitted to three flights
reference_gain_db: -44.5
exponent: 2.0
elevation_db: [18, -30, 10]
spread_db: 5.5
correlation_m: 42
about: three flights of May
"""


def written(folder: Path, changes: dict[str, Any], link: str = LINK) -> Path:
    """Write a plan with these `changes` into `folder`, and link.yaml beside it."""
    (folder / "link.yaml").write_text(link)
    plan = folder / "plan.yaml"
    plan.write_text(edited(SMALL, changes))
    return plan


def refused(plan: Path) -> str:
    with pytest.raises(PlanError) as caught:
        read_plan(plan)
    return str(caught.value)


def test_a_law_of_a_file_is_that_of_both_hops_or_of_one(tmp_path: Path) -> None:
    both = read_plan(written(tmp_path, {"radio.gain": "link.yaml"}))
    for law in both.radio.path_gains:
        assert law.reference_gain == pytest.approx(10**-4.45)
        assert law.elevation_db == (18, -30, 10)
    assert parse_plan(both.text).radio == both.radio  # without the file
    one = read_plan(written(tmp_path, {"radio.ground_user.gain": "link.yaml"}))
    assert [law.square for law in one.radio.path_gains] == [True, False]
    assert one.radio.path_gains[0].reference_gain == one.radio.reference_gain
    assert one.radio.gain_laws[1].spread_db == 5.5


@pytest.mark.parametrize(
    ("link", "told"),
    [
        ("exponent: two\n", "link.yaml: exponent: 'two' is not accepted; give a number, 0 to 10"),
        ("exponents: 2\n", "link.yaml: exponents: unknown key; did you mean exponent?"),
        ("elevation_db: [1, 2, 3, 4]\n", "link.yaml: elevation_db: [1, 2, 3, 4] is not accepted"),
        ("reference_gain_db: .nan\n", "link.yaml: reference_gain_db: nan is not a finite number"),
        ("reference_gain_db: -20\nelevation_db: [90]\n", "radio.gain: 37.96 dB at 40 m"),
        ("- 2.0\n", "link.yaml: "),
        ("exponent: [2\n", "link.yaml: line 2"),
    ],
)
def test_what_is_wrong_in_the_file_is_told_with_its_name(
    tmp_path: Path, link: str, told: str
) -> None:
    message = refused(written(tmp_path, {"radio.gain": "link.yaml"}, link))
    assert message.startswith(f"{tmp_path / 'plan.yaml'}: radio.gain: ")
    assert told in message
    assert len(message.splitlines()) == 1


def test_a_file_that_is_not_there_and_no_law_at_all(tmp_path: Path) -> None:
    assert "radio.gain: " in (message := refused(written(tmp_path, {"radio.gain": "other.yaml"})))
    assert "other.yaml: cannot be read" in message
    for value in (3, [2.0], True):
        assert "or the name of a file" in refused(written(tmp_path, {"radio.gain": value}))


def test_algorithm1_keeps_to_the_square_of_the_distance(paper_plan: MakePlan) -> None:
    with pytest.raises(PlanError, match=r"radio\.gain is not for algorithm1"):
        optimize(paper_plan({"radio.gain.exponent": 2.5}))
