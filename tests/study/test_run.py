"""A study runs, is interrupted, goes on, fails in parts, and is drawn."""

import csv
import json
import math
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import PATIENCE, SMALL, edited
from distributed import LocalCluster
from full_disk import files_of_at_most
from planted import plant
from typer.testing import CliRunner

from faao_mav import optimize, price
from faao_mav.cli.main import app
from faao_mav.errors import InputError
from faao_mav.plan import parse_plan
from faao_mav.report.style import save_figure
from faao_mav.study import StudyRow, load_rows, make_cases, parse_vary, run_study
from faao_mav.study.figure import study_figure
from faao_mav.study.rows import as_array, comparison, table

FEW = {"radio.fading": "none", "optimizer.starts": ["straight"], "flight.time_step": 1}
QUICK = edited(SMALL, FEW)
CASES = make_cases(QUICK, vary={"power_dbm": (0, 10)}, schemes=("faao", "mrt"))
Whole = tuple[Path, tuple[StudyRow, ...]]

CALL = """
import os
from pathlib import Path
from faao_mav.study import make_cases, run_study
if __name__ == "__main__":
    cases = make_cases(Path("plan.yaml").read_text(), vary={"power_dbm": (0, 10)})
    print(len(run_study(cases, jobs=2)), "PYTHONSAFEPATH" in os.environ)
"""
"""A study that is called from Python."""


def timeless(rows: tuple[StudyRow, ...]) -> list[StudyRow]:
    return [replace(row, seconds=None) for row in rows]


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, ["study", *map(str, arguments)])


def table_in(directory: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((directory / "table.csv").read_text().splitlines()))


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    path = tmp_path / "plan.yaml"
    path.write_text(QUICK)
    return path


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Whole:
    directory = tmp_path_factory.mktemp("whole")
    return directory, run_study(CASES, jobs=1, directory=directory)


def test_a_row_is_what_the_plan_gives(whole: Whole) -> None:
    row, solution = whole[1][2], optimize(parse_plan(CASES[2].text))
    assert (row.values, row.scheme) == ({"power_dbm": 10}, "faao")
    assert row.R_avg == solution.rates.R_avg == min(row.R_U or 0, row.R_G or 0)
    assert row.mutual_information == price(solution).average
    assert (row.converged, row.iterations, row.error) == (True, solution.iterations, "")
    assert len(row.route) == len(solution.w)
    assert comparison([row]).startswith("R_avg, bit/s/Hz\n")
    other = replace(row, rate="mutual_information")
    assert comparison([other]).startswith("R_avg, bit/s/Hz of mutual information\n")
    # a case that makes the same plan shares the row and keeps its values
    same = {"radio.causal": (False,), "vehicle.max_speed": (20,), "power_dbm": (10,)}
    (again,) = run_study(make_cases(QUICK, vary=same), jobs=1, directory=whole[0])
    assert (again.key, again.seconds, again.R_avg) == (row.key, row.seconds, row.R_avg)
    assert again.values == {"radio.causal": False, "vehicle.max_speed": 20, "power_dbm": 10}
    assert again.route == row.route


def test_a_resumed_study_is_the_uninterrupted_one(tmp_path: Path, whole: Whole) -> None:
    seen: list[StudyRow] = []

    def stop(row: StudyRow) -> None:
        seen.append(row)
        if len(seen) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_study(CASES, jobs=1, directory=tmp_path, observe=stop)
    assert len([*(tmp_path / "rows").iterdir()]) == 2
    again = run_study(CASES, jobs=1, directory=tmp_path)
    assert timeless(again) == timeless(whole[1])
    assert again[:2] == tuple(seen)  # not run again
    assert len(load_rows(tmp_path, CASES)) == len(CASES)
    assert [row["scheme"] for row in table_in(tmp_path)] == ["faao", "mrt"] * 2


def test_processes_and_a_cluster_do_not_change_the_result(whole: Whole) -> None:
    assert timeless(run_study(CASES, jobs=2)) == timeless(whole[1])
    local = {"host": "127.0.0.1", "protocol": "tcp", "dashboard_address": None}
    start: Any = LocalCluster
    with start(n_workers=1, threads_per_worker=1, processes=False, **local) as cluster:
        rows = run_study(CASES, cluster=cluster.scheduler_address)
    assert timeless(rows) == timeless(whole[1])


def test_modules_beside_the_plan_are_not_run(plan: Path) -> None:
    ran, script = plant(plan.parent), plan.parent / "elsewhere" / "call.py"
    script.parent.mkdir()
    script.write_text(CALL)
    done = subprocess.run(
        [sys.executable, script], cwd=plan.parent, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "2 False\n", "")
    assert not ran.exists()


def test_what_is_refused(plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("faao_mav.study.runner._CONNECTING", 0.5)
    for told, *arguments in (
        ("cluster tcp://127.0.0.1:1: no scheduler there", "--cluster", "tcp://127.0.0.1:1"),
        ("cluster nonsense://x: no scheduler there", "--cluster", "nonsense://x"),
        ("radio.modulation: 'fsk' is not accepted", "--vary", "radio.modulation=fsk,ook"),
        ("flight.duraton: unknown key; did you mean duration?", "--vary", "flight.duraton=10"),
        ("modulation: unknown key; did you mean radio.modulation?", "--vary", "modulation=qpsk"),
        ("sets the same", "--vary", "flight.altitude=50", "--vary", "flight.altitude=60"),
        ("sets the same", "--power", "10", "--vary", "radio.relay.power_dbm=20"),
        ("study.schemes[1]: 'rzf' is not accepted; give a list of faao", "--schemes", "faao, rzf"),
        ("jobs 0: give", "--jobs", 0),
        ("--points 3: is for a frontier", "--points", 3),
    ):
        result = run(plan, *arguments, "--out", tmp_path / "out")
        assert result.exit_code == 2, result.output
        assert told in result.stderr
    assert not (tmp_path / "out").exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file/rows: cannot be made: Not a directory"):
        run_study(CASES, jobs=1, directory=tmp_path / "file")
    (tmp_path / "table.csv").mkdir()
    with pytest.raises(InputError, match=r"table\.csv: is a directory"):
        run_study(CASES, jobs=1, directory=tmp_path)
    assert [*(tmp_path / "rows").iterdir()] == []


def test_options_go_before_the_plans_study_and_a_failing_row_is_one(
    plan: Path, tmp_path: Path
) -> None:
    study = {"vary": {"power_dbm": [0, 10]}, "schemes": ["faao"], "seeds": 2}
    plan.write_text(edited(QUICK, {"study": study}))
    rows = json.loads(run(plan, "--json", "--jobs", 1).stdout)["rows"]
    assert [(row["power_dbm"], row["seed"]) for row in rows] == [(0, 0), (0, 1), (10, 0), (10, 1)]
    other = run(plan, "--power", "5", "--seeds", 1, "--schemes", "zf", "--json", "--jobs", 1)
    rows = json.loads(other.stdout)["rows"]
    assert [(row["power_dbm"], row["scheme"], row["seed"]) for row in rows] == [(5, "zf", 0)]
    plan.write_text(QUICK)
    vary = "flight.start={latitude: -35.3629, longitude: 149.1652},[0, 50]"
    result = run(plan, "--vary", vary, "--jobs", 1)
    assert result.exit_code == 0, result.output
    assert '{"latitude": -35.3629, "longitude": 149.1652}' in result.stdout
    out = tmp_path / "out"
    result = run(plan, "--vary", "flight.duration=4,10", "--jobs", 1, "--out", out)
    assert result.exit_code == 0, result.output
    assert "1 of 2 rows failed, first:" in result.stdout
    short, good = table_in(out)
    assert "too short" in short["error"]
    assert short["R_avg"] == good["error"] == ""
    assert float(good["R_avg"]) > 0
    plan.write_text(edited(QUICK, {"radio.fading": "ergodic"}))
    result = run(plan, "--schemes", "algorithm1", "--jobs", 1)
    assert result.exit_code == 1
    assert "1 of 1 row failed" in result.stdout
    assert "ergodic" in result.stdout


def test_what_is_no_row_is_refused_by_its_file(whole: Whole, tmp_path: Path) -> None:
    name = f"rows/{CASES[1].key}.json"
    sound, kept = json.loads((whole[0] / name).read_text()), tmp_path / name
    kept.parent.mkdir()
    changed: dict[str, dict[str, Any]] = {
        "seed: Input should be a valid integer": {"seed": "0"},
        "delivered: Input should be a finite number": {"delivered": math.nan},
        r"route\[1\]\[1\]: Field required": {"route": [[1, 2], [3]]},
        r"route\[0\]\[0\]: Input should be a finite number": {"route": [[1e999, 0]]},
        "more: Unexpected keyword argument": {"more": 1},
    }
    texts = {said: json.dumps(sound | changes).encode() for said, changes in changed.items()}
    others = b'{"no": "row"}', b"[" * 100_000, b'{"key": "\xff"}', b"1", b"", b"9" * 10**6
    for said, content in [*texts.items(), *(("", each) for each in others)]:
        kept.write_bytes(content)
        with pytest.raises(InputError, match=rf"{name}: no row of a study: {said}"):
            run_study(CASES, jobs=1, directory=tmp_path)


def test_a_study_on_a_full_disk_keeps_whole_rows_and_goes_on(
    tmp_path: Path, whole: Whole, plan: Path
) -> None:
    rows = tmp_path / "out" / "rows"
    asked = (plan, "--schemes", "faao,mrt", "--jobs", 1, "--out", rows.parent, "--power")
    assert run(*asked, "0").exit_code == 0
    with files_of_at_most(100):  # a part of a row
        result = run(*asked, "0,10")
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert f"{rows}/{CASES[2].key}.json: cannot be written: File too large; the rows before" in line
    assert {each.name for each in rows.iterdir()} == {f"{case.key}.json" for case in CASES[:2]}
    assert run(*asked, "0,10").exit_code == 0
    assert timeless(load_rows(rows.parent, CASES)) == timeless(whole[1])


def test_rates_routes_and_causality_are_drawn(plan: Path, whole: Whole, tmp_path: Path) -> None:
    name = "中 $\\frac"
    plan.write_text(edited(QUICK, {"name": name}))
    out = tmp_path / "out"
    arguments = (plan, "--power", "0,10", "--jobs", 1, "--out", out)
    assert run(*arguments).exit_code == 0
    drawn = (out / "figure.svg").read_text()
    for text in (name, "power W of both stations, dBm", "delivered rate R_del, bit/s/Hz", "FAAO"):
        assert text in drawn
    assert (out / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert run(*arguments).exit_code == 0
    assert (out / "figure.svg").read_text() == drawn
    figure = study_figure(whole[1], parse_plan(plan.read_text()), "trajectories")
    save_figure(figure, tmp_path / "f.pdf")
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("east, m", "north, m")
    names = {text.get_text() for text in axes.texts}
    assert names == {"base station", "user", "start", "end"}
    failed = (StudyRow("k", {"power_dbm": 1}, "faao", 0, error="no"),)
    wrong = (("trajectories", failed), ("delivered", whole[1][:1]), ("rate", ()), ("routes", ()))
    for kind, rows in wrong:
        with pytest.raises(InputError, match=r"nothing to draw|figure 'routes': give delivered"):
            study_figure(rows, parse_plan(QUICK), kind)
    # rows of several studies or of none are one table
    ends = [StudyRow("", {"end": [1, 2]}, "faao", 0), StudyRow("", {"end": [3, 4]}, "zf", 0)]
    assert as_array(ends)["end"].tolist() == [[1, 2], [3, 4]]
    several = [StudyRow("", {"H": 60}, "faao", 0), StudyRow("", {"power_dbm": 5}, "zf", 0)]
    assert np.isnan(as_array(several)["H"]).tolist() == [False, True]
    assert table(several).startswith("H,power_dbm,scheme,")
    for empty in (as_array(()), table(()).splitlines()[1:]):
        assert len(empty) == 0
    vary = {"flight.duration": (10, 12), "radio.causal": (True, False)}
    rows = run_study(make_cases(QUICK, vary=vary), jobs=1)
    for planned, paper in zip(rows[::2], rows[1::2], strict=True):
        assert (planned.values["radio.causal"], paper.values["radio.causal"]) == (True, False)
        assert (planned.delivered or 0.0) >= (paper.delivered or math.inf) - 1e-4
    (plot,) = study_figure(rows, parse_plan(SMALL), "delivered").axes
    labels = [str(line.get_label()) for line in plot.lines]
    assert "; ".join(labels) == (
        "R_avg, planned for it; delivered, planned for it; delivered, planned for R_avg"
    )


def test_ctrl_c_leaves_a_directory_to_go_on_with(plan: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    # parallel tests run with the signal ignored, which a child inherits
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from faao_mav.cli.main import run; run()"
    )
    command = [sys.executable, "-c", code, "study", plan, "--power", "0:20:0.1", "--jobs", 2,
               "--out", out]  # fmt: skip
    process = subprocess.Popen(
        [*map(str, command)], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline and not [*out.glob("rows/*.json")]:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert f"interrupted; finished rows are in {out}; the same command goes on there" in said
    assert "Traceback" not in said
    assert load_rows(out, make_cases(QUICK, vary=dict([parse_vary("power_dbm=0:20:0.1")])))
