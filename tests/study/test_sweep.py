"""What a study runs: values, grids, and the plans that they make."""

from fractions import Fraction

import pytest
from conftest import MISSIONS, SMALL, edited
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.errors import InputError, PlanError
from faao_mav.plan import parse_plan, read_plan
from faao_mav.study import make_cases, parse_vary
from faao_mav.study.sweep import MAX_ROWS, parse_schemes, parse_values


@given(
    start=st.integers(-1000, 1000),
    step=st.integers(1, 50),
    count=st.integers(0, 40),
    rest=st.floats(0, 0.99),
    digits=st.integers(0, 4),
)
def test_a_range_has_its_ends_and_equal_steps(
    start: int, step: int, count: int, rest: float, digits: int
) -> None:
    scale = 10**digits
    stop = start + step * count + int(rest * step)
    text = ":".join(f"{Fraction(n, scale).numerator / Fraction(n, scale).denominator:.{digits}f}"
                    for n in (start, stop, step))  # fmt: skip
    values = parse_values(text, "--power")
    assert values == tuple((start + k * step) / scale for k in range(count + 1))


@given(st.text(max_size=30))
def test_any_text_is_values_or_a_message(text: str) -> None:
    try:
        assert parse_values(text, "--power")
    except InputError as error:
        assert "--power" in str(error)


def test_values_are_those_of_yaml() -> None:
    assert parse_values("-40:0:5", "--power") == tuple(range(-40, 1, 5))
    assert parse_values("10:0:-4", "--power") == (10, 6, 2)
    assert parse_values("1, 5:7:1, 2.5", "--power") == (1, 5, 6, 7, 2.5)
    assert parse_vary("flight.start=[0, 350],[0,100]") == (
        "flight.start",
        ([0, 350], [0, 100]),
    )
    assert parse_vary("radio.causal=false,true")[1] == (False, True)


def test_what_cannot_be_varied_is_said() -> None:
    for text, part in (
        ("radio.modulation", "key=start:stop:step"),
        ("radio.modulaton=qpsk", "did you mean radio.modulation?"),
        ("modulation=qpsk", "did you mean radio.modulation?"),
        ("radio=1", "a section cannot be varied; give one of radio.base_station."),
        ("name=a,b", "unknown key"),
        ("study.seeds=1", "unknown key"),
        ("flight.duration=", "neither"),
        ("flight.duration=1:2", "no range"),
        ("flight.duration=1:2:0", "no range"),
        ("flight.duration=1:2:-1", "steps that come from start to stop"),
        ("flight.duration=1:inf:1", "no range"),
        ("flight.duration=1:2:inf", "no range"),
        ("flight.duration=0:1:1e-9", "1e+09 rows; a study has at most 100,000"),
        ("flight.duration=0:1e999999:1e-999999", "no range"),
        ("flight.duration=1e999999:1e999999:1", "no range"),
        ("flight.duration=0:1:1e-999999", "no range"),
        ("\x1b[2J=1", r"--vary \x1b[2J: unknown key"),
        ("k" * 1000 + "=1", "--vary " + "k" * 57 + "...: unknown key"),
        ("flight.duration=1], more: [2", "neither"),
    ):
        with pytest.raises(InputError) as caught:
            parse_vary(text)
        assert part in str(caught.value)
    with pytest.raises(InputError, match="at most 100,000"):
        make_cases(SMALL, vary={"radio.seed": tuple(range(MAX_ROWS // 2 + 1))}, seeds=2)


def test_schemes_are_methods_precoders_and_inputs() -> None:
    assert parse_schemes("faao, zf,faao") == ("faao", "zf")
    with pytest.raises(InputError, match="--schemes rzf: expected some of faao,algorithm1"):
        parse_schemes("faao,rzf")
    with pytest.raises(PlanError, match="'rzf' is not accepted; give a list of faao"):
        parse_plan(edited(SMALL, {"study": {"schemes": ["rzf"]}}))
    cases = make_cases(SMALL, vary={}, schemes=("faao", "algorithm1", "mrt"))
    made = [parse_plan(case.text).optimizer for case in cases]
    assert [(each.method, each.precoder) for each in made] == [
        ("direct", "faao"),
        ("algorithm1", "faao"),
        ("direct", "mrt"),
    ]


def test_the_grid_is_every_plan_once() -> None:
    cases = make_cases(
        SMALL,
        vary={"power_dbm": (0, 10), "radio.modulation": ("bpsk", "qpsk")},
        schemes=("faao", "gaussian"),
        seeds=3,
    )
    assert len({case.key for case in cases}) == len(cases) == 2 * 2 * 2 * 3
    for case in cases:
        plan, values = parse_plan(case.text), dict(case.values)
        watts = 10 ** ((values["power_dbm"] - 30) / 10)
        assert plan.radio.base_station.power == plan.radio.relay.power == pytest.approx(watts)
        assert plan.radio.modulation == values["radio.modulation"]
        assert plan.optimizer.inputs == ("gaussian" if case.scheme == "gaussian" else "alphabet")
        assert plan.radio.seed == case.seed in (0, 1, 2)
        assert plan.study is None


def test_the_same_work_has_the_same_key_whatever_the_study() -> None:
    wide = make_cases(SMALL, vary={"radio.rician_factor": (1, 2, 3)})
    narrow = make_cases(SMALL + "study: {seeds: 4}\n", vary={"radio.rician_factor": (2,)})
    assert narrow[0].key == wide[1].key


def test_the_study_of_a_plan() -> None:
    text = SMALL + "study: {vary: {flight.duration: [10, 12]}, schemes: [faao, zf], seeds: 2}\n"
    study = parse_plan(text).study
    assert study is not None
    assert study.vary == {"flight.duration": (10, 12)}
    assert (study.schemes, study.seeds, study.figure) == (("faao", "zf"), 2, "delivered")
    assert parse_plan(SMALL).study is None


@pytest.mark.parametrize("name", ["paper_fig3", "paper_fig4", "gaussian_cost"])
def test_sample_studies_are_of_section_iv(name: str) -> None:
    plan, paper = (read_plan(MISSIONS / f"{each}.yaml") for each in (name, "paper_active"))
    assert plan.study is not None
    assert (plan.flight.start, plan.flight.end) == (paper.flight.start, paper.flight.end)
    assert (plan.vehicle, plan.powers) == (paper.vehicle, paper.powers)
    assert plan.radio.relay.noise >= paper.radio.relay.noise
    for case in make_cases(plan.text, vary=plan.study.vary, schemes=plan.study.schemes):
        assert parse_plan(case.text).flight.altitude == 100
