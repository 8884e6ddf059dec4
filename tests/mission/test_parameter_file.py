"""Files of autopilot parameters, against themselves, pymavlink and damaged files."""

import math
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.mavparm import MAVParmDict

from faao_mav.errors import ParameterFileError
from faao_mav.mission.formats.parameter_file import read_parameters, render_parameters

TEXTS = Path(__file__).parents[1] / "data" / "parameters.txt"

names = st.from_regex(r"[A-Z][A-Z0-9_]{0,15}", fullmatch=True)
numbers = st.floats(allow_nan=False, allow_infinity=False)
integers = st.integers(-(2**31), 2**31 - 1)


def read(text: str | bytes, folder: Path) -> dict[str, float]:
    path = folder / "x.param"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_parameters(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("parameters")


@given(st.dictionaries(names, numbers | integers, min_size=1, max_size=8))
def test_files_are_read_back_and_by_pymavlink(folder: Path, parameters: dict[str, float]) -> None:
    assert repr(read(render_parameters(parameters, "qgroundcontrol"), folder)) == repr(parameters)
    text = render_parameters(parameters, "list", header="for a test\n\nof it")
    assert read(text, folder) == {name: float(value) for name, value in parameters.items()}
    loaded = MAVParmDict()
    assert loaded.load(str(folder / "x.param"), use_excludes=False)
    assert dict(loaded) == parameters


def test_the_form_that_qgroundcontrol_has(tmp_path: Path) -> None:
    parameters = {"MPC_ACC_HOR": 5.0, "MIS_TKO_LAND_REQ": 2, "NAV_ACC_RAD": 2e-5}
    assert render_parameters(parameters, "qgroundcontrol", header="Timed for these.") == (
        "# Timed for these.\n"
        "#\n"
        "# Vehicle-Id Component-Id Name Value Type\n"
        "1\t1\tMPC_ACC_HOR\t5\t9\n"
        "1\t1\tMIS_TKO_LAND_REQ\t2\t6\n"
        "1\t1\tNAV_ACC_RAD\t0.00002\t9\n"
    )
    text = (
        "# Onboard parameters for Vehicle 1\n#\n# Stack: PX4 Pro\n# Vehicle: Multi-Rotor\n"
        "# Vehicle-Id Component-Id Name Value Type\n"
        "1\t1\tCOM_RC_IN_MODE\t1\t6\n"
        "1\t1\tMPC_ACC_HOR\t3.000000000000000000\t9\n"
        "1\t154\tGMB_USR1\t5\t6\n"
    )
    assert repr(read(text, tmp_path)) == "{'COM_RC_IN_MODE': 1, 'MPC_ACC_HOR': 3.0}"
    assert read(text.replace("\t", "   "), tmp_path) == read(text, tmp_path)


def test_harmless_oddities_are_read_damage_is_named(tmp_path: Path) -> None:
    damaged: list[tuple[str | bytes, str]] = [
        (b"A,1\nB,\xff\n", "line 2: byte 0xff is not UTF-8"),
        (b"#" * 4_000_001, "more than 4,000,000 bytes; expected a file of parameters"),
    ]
    for row in TEXTS.read_text().splitlines()[1:]:
        text, told = row.split(" | ")
        text = text.encode().decode("unicode_escape")
        if told == "read":
            assert read(text, tmp_path) == {"A": 1, "B": 2.5}
        else:
            damaged.append((text, told))
    for broken, told in damaged:
        with pytest.raises(ParameterFileError, match=re.escape(told)) as caught:
            read(broken, tmp_path)
        assert str(caught.value).startswith(str(tmp_path / "x.param: "))
    for name, value, told in (
        ("A" * 17, 1.0, "expected at most 16 capitals"),
        ("A", math.nan, "parameter A: nan; expected a finite number"),
        ("A", 2**31, "parameter A: 2147483648; expected a finite number, an integer within 32"),
    ):
        with pytest.raises(ParameterFileError, match=told):
            render_parameters({name: value}, "qgroundcontrol")
