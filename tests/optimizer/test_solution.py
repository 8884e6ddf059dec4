"""Saving, loading, proving and pricing of solutions."""

import io
import struct
import tracemalloc
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import MakePlan, contents

from faao_mav import files
from faao_mav.errors import InputError
from faao_mav.optimizer.optimize import optimize
from faao_mav.optimizer.pricing import SATURATED, price, saturation
from faao_mav.optimizer.solution import Rates, Solution, load_solution, save_solution
from faao_mav.workflow import Result

FEW = {"radio.fading": "realization", "optimizer.starts": ["straight"]}


@pytest.fixture(scope="module")
def solution(small_plan: MakePlan) -> Solution:
    faint = {"radio.base_station.power_dbm": 0, "radio.relay.power_dbm": 0}
    return optimize(small_plan(FEW | faint))


def test_loaded_is_what_was_saved(solution: Solution, tmp_path: Path) -> None:
    save_solution(solution, tmp_path / "result.npz")
    loaded = load_solution(tmp_path / "result.npz")
    assert loaded.rates == solution.rates
    assert loaded.w.tobytes() == solution.w.tobytes()
    assert contents(loaded.plan) == contents(solution.plan)
    assert max(loaded.residuals().values()) < 1e-6
    save_solution(loaded, tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "result.npz").read_bytes()
    with np.load(tmp_path / "result.npz", allow_pickle=False) as saved:
        shapes = {name: saved[name].shape for name in saved.files}
        assert str(saved["plan"]) == solution.plan.text
        assert float(saved["R_avg"]) == solution.rates.R_avg
    slots, square = (20,), (20, 2, 2)
    expected = {"t": slots, "w": (20, 2), "v": (20, 2), "a": (20, 2), "P_B": square, "P_U": square,
                "H_rB": square, "H_rU": square, "I_U": slots, "I_G": slots, "R_avg": (), "R_U": (),
                "R_G": (), "history": solution.history.shape, "plan": ()}  # fmt: skip
    assert {name: shapes[name] for name in expected} == expected


def npy(header: str, data: bytes = b"") -> bytes:
    """Return an .npy file with this text in its header."""
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + data


HUGE = "{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999,), }\n"
OBJECT = "{'descr': '|O', 'fortran_order': False, 'shape': (1,), }\n"
WORDS = "{'descr': '<U3', 'fortran_order': False, 'shape': (), }\n"


def test_what_is_no_result_is_refused(
    solution: Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, other = tmp_path / "result.npz", tmp_path / "other.npz"
    save_solution(solution, path)
    for name, member, said in (
        ("history", npy(HUGE), "not a result of faao-mission --save"),
        ("history", npy("(" * 500), "not a result of faao-mission --save"),
        ("history", npy(OBJECT, b"\x80\x04N."), "not a result"),
        ("history", b"no array", "not a result"),
        ("history", np.empty(0), r"history: float64 \(0,\); expected numbers \(1,\)"),
        ("converged", np.array("yes"), r"converged: <U3 \(\); expected numbers \(\)"),
        ("plan", np.array(5), r"plan: int64 \(\); expected text"),
        ("ending", npy(WORDS, b"\xff" * 12), "not a result of faao-mission --save"),
        ("starts", np.array("[1]"), r"starts: '\[1\]'; expected rates by start"),
        ("starts", np.array("[" * 100_000), "starts: .*; expected rates by start"),
        ("H_rB", np.ones((4, 20, 2, 2)), r"H_rB: float64 \(4, 20, 2, 2\)"),
        ("w", np.zeros((20, 2), dtype=complex), "w: complex128"),
        ("w", np.full((20, 2), np.nan), "w: expected finite numbers"),
        ("P_B", np.full((20, 2, 2), 1e200), "P_B: expected finite numbers below 1e\\+100"),
        ("t", np.zeros(20), "t: expected the times of the slots"),
        ("P_B", np.ones((20, 1, 2)), r"P_B: float64 \(20, 1, 2\); expected numbers \(20, 2, 2\)"),
    ):
        if not isinstance(member, bytes):
            np.save(content := io.BytesIO(), member)
            member = content.getvalue()
        with zipfile.ZipFile(path) as source, zipfile.ZipFile(other, "w") as target:
            for each in source.namelist():
                target.writestr(each, member if each == f"{name}.npy" else source.read(each))
        with pytest.raises(InputError, match=rf"other\.npz: {said}"):
            load_solution(other)
    path = tmp_path / "result.npz"
    save_solution(solution, path)
    saved = path.read_bytes()
    directory = saved.index(b"PK\1\2")
    for offset, value in ((8, 1), (10, 99), (6, 255)):  # encrypted, packed otherwise, of the future
        changed = bytearray(saved)
        changed[directory + offset] = value  # what the directory says of "t"
        changed[offset - 2] = value  # what the member says of itself
        path.write_bytes(changed)
        with pytest.raises(InputError, match="not a result of faao-mission --save"):
            load_solution(path)
    with zipfile.ZipFile(path, "w") as packed:  # a directory without an end is not read
        for number in range(3000):
            packed.writestr(f"{number}.npy", b"")
    endless = path.read_bytes()
    for broken in (endless, b"", b"PK\x03\x04 broken", b"\x80\x04N.", b"text"):
        path.write_bytes(broken)
        with pytest.raises(InputError, match=r"result\.npz: not a result of faao-mission --save"):
            load_solution(path)
    with pytest.raises(InputError, match="cannot be read"):
        load_solution(tmp_path / "absent.npz")
    np.savez(path, t=np.arange(3))
    with pytest.raises(InputError, match="not a result"):
        load_solution(path)
    # what is unpacked before that is in memory once: 400 MB at most
    monkeypatch.setattr(files, "MAX_BYTES", 1_000_000)
    path = tmp_path / "result.npz"
    for size, told in ((9_000_000, "more than 1,000,000 bytes"), (900_000, "not a result of faao")):
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
            packed.writestr("plan.npy", bytes(size))
        tracemalloc.start()
        try:
            with pytest.raises(InputError, match=told):
                load_solution(path)
            assert tracemalloc.get_traced_memory()[1] < 1_500_000
        finally:
            tracemalloc.stop()


def test_a_tampered_solution_proves_nothing(solution: Solution) -> None:
    assert replace(solution, P_B=1.1 * solution.P_B).residuals()[
        "(13b) power of the base station"
    ] == pytest.approx(0.21, rel=1e-3)
    assert replace(solution, I_U=solution.I_U + 9).residuals()["(9) rate"] > 8.9
    assert replace(solution, H_rU=solution.H_rU * 1j).residuals()["(2) fading"] > 0.1
    assert replace(solution, w=solution.w + 1).residuals()["(13d) ends"] == pytest.approx(1)
    assert solution.is_feasible()
    assert not replace(solution, P_B=1.1 * solution.P_B).is_feasible()


def test_mutual_information_is_above_the_cutoff_rate(solution: Solution) -> None:
    information, rates = price(solution), solution.rates
    assert information.error <= 1e-3
    assert rates.R_U < information.bs_uav < 2
    assert rates.R_G < information.uav_user < 2
    assert information.average == min(information.bs_uav, information.uav_user)
    assert price(solution) == information
    told = Result(solution, information=information).as_dict()
    names = ("average", "bs_uav", "uav_user", "delivered", "error")
    keys = ("mutual_information", *(f"mutual_information_{name}" for name in names[1:]))
    assert [told[key] for key in keys] == [getattr(information, name) for name in names]
    assert information.bs_uav != information.uav_user


def test_mutual_information_of_many_slots_is_that_of_few(small_plan: MakePlan) -> None:
    changes = {"radio.base_station.power_dbm": 0, "radio.relay.power_dbm": 0}
    few, many = (
        price(optimize(small_plan(changes | {"radio.fading": "none", "flight.time_step": step})))
        for step in (0.1, 0.02)  # 100 slots, and 500, which are sampled
    )
    assert many.average == pytest.approx(few.average, abs=0.01)
    assert many.delivered == pytest.approx(few.delivered, abs=0.01)


def test_spare_power_is_what_could_be_saved(solution: Solution, small_plan: MakePlan) -> None:
    assert not saturation(solution).saturated
    assert saturation(solution).spare_db == 0
    powers = {"radio.base_station.power_dbm": 40, "radio.relay.power_dbm": 40}
    found = optimize(small_plan(FEW | powers))
    limit = saturation(found)
    assert limit.saturated
    assert limit.ceiling == 2
    assert 5 < limit.spare_db < 40
    at_limit = Rates.of(*found.recomputed_slots(10 ** (-limit.spare_db / 10))).R_avg
    assert 0 <= at_limit - SATURATED * 2 < 1e-5
