"""The readers of files, as fuzzers see them."""

import os
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout, suppress
from functools import partial
from pathlib import Path

import mutate
import numpy as np
from conftest import MISSIONS, SMALL
from flight_logs import kept, ulog
from harness import Target

from faao_mav import optimize, parse_plan
from faao_mav.errors import InputError, MissionFileError
from faao_mav.fly.logs import flights, messages
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence_area import FreeArea, areas_of
from faao_mav.mission.formats import read_mission_file, render_files
from faao_mav.mission.formats.fence_file import read_fence
from faao_mav.mission.formats.parameter_file import read_parameters
from faao_mav.optimizer.solution import load_solution, save_solution
from faao_mav.plan import read_plan
from faao_mav.radio.gain_map import GainMap
from faao_mav.radio.map_file import map_archive, read_map
from faao_mav.study import run_study
from faao_mav.study.rows import ROWS, comparison, load_rows, table
from faao_mav.study.sweep import make_cases, parse_vary
from faao_mav.validate.flown import FlightRecord

_DATA = Path(__file__).parent.parent / "data"

_BRIEF = SMALL + "optimizer: {max_iterations: 1, starts: [straight]}\n"

_STUDY = (
    SMALL
    + """
study:
  vary: {power_dbm: [-40, 0.5, 1e1], radio.modulation: [bpsk, 8psk]}
  schemes: [faao, mrt]
mission: {parameters: keep, takeoff: false}
"""
)

_PARAMETERS = (
    b"# vehicle\nWPNAV_SPEED,800\nWPNAV_JERK 1.5\nFENCE_TYPE 0x7 # circle\nSYS_ID,1,@READONLY\n",
    b"# Vehicle-Id Component-Id Name Value Type\n1\t1\tMPC_XY_CRUISE\t5.000\t9\n1\t1\tNAV\t3\t6\n",
)

_FENCED = (
    SMALL
    + """
fence:
  inclusion: [[-50, -50], [120, -50], [120, 120], [-50, 120]]
  exclusion: [{center: [30, 30], radius: 4}, {polygon: [[20, 5], [25, 5], [25, 9]]}]
  margin: 2
"""
)

_LINK = (
    b"reference_gain_db: -44.5\nelevation_db: [18, -30, 10]\nspread_db: 5.5\nabout: May\n"
    b"elevation_deg: [2, 50]\n"
)
_RATES = b"# own\nmcs, snr_db, mbit_per_s\n0, 4, 6.5\n1, 7, 13\n2, 9.5, 19.5\n"
_MAP = b"# own\neast_m, north_m, gain_db\n0, 0, -80\n0, 9, -81.5\n9, 0, nan\n9, 9, -83\n"

_LARGEST_SEED = 5_000
"""Bytes of a mission that is mutated; chosen: small ones are read often."""

_CHANGES = {".npz": mutate.archive} | dict.fromkeys((".bin", ".tlog", ".ulg"), mutate.binary)
"""How files with these endings are mutated; others are as text."""

_VALUES = (b"flight.duration=60:120:30", b"power_dbm=-40:0:5,7", b"radio.modulation=bpsk,8psk")


def _beside(plan: Path, _: Path) -> object:
    return read_plan(plan)


def targets(directory: Path) -> dict[str, Target]:
    """Return the targets by name; the files that they read are written to `directory`."""
    found: dict[str, Target] = {}

    def add(name: str, file: str, read: Callable[[Path], object], *seeds: bytes) -> None:
        def run(content: bytes) -> object:
            path = directory / file
            path.write_bytes(content)
            return read(path)

        found[name] = Target(name, run, seeds, _CHANGES.get(Path(file).suffix, mutate.text))

    for beside in MISSIONS.glob("*.csv"):
        (directory / beside.name).write_bytes(beside.read_bytes())
    plans = [path.read_bytes() for path in sorted(MISSIONS.glob("*.yaml"))]
    add("plan", "plan.yaml", read_plan, SMALL.encode(), _STUDY.encode(), *plans)
    add("fenced_plan", "fenced.yaml", read_plan, _FENCED.encode())
    for key, name, seed in (("gain", "link.yaml", _LINK), ("rates", "rates.csv", _RATES)):
        plan = directory / f"{key}.yaml"
        plan.write_text(f"{SMALL}  bandwidth_mhz: 20\n  {key}: {name}\n")
        add(key, name, partial(_beside, plan), seed)
    side = np.arange(3.0)
    known = GainMap(
        side, side, side[1:], np.full((2, 3, 3), -90.0), False, np.ones((3, 3)), (47, 8)
    )
    add("map", "map.npz", read_map, map_archive(known))
    add("map_table", "map.csv", read_map, _MAP)
    zones = _DATA / "fences" / "zones"
    for ending in ("kml", "geojson"):
        add(ending, f"fence.{ending}", _fence, zones.with_suffix(f".{ending}").read_bytes())
    add("wpl", "mission.waypoints", _mission, *_missions("*.waypoints", "*.txt"))
    add("qgc_plan", "mission.plan", _mission, *_missions("*.plan"))
    add("parameters", "vehicle.param", read_parameters, *_PARAMETERS)
    solution = directory / "solution.npz"
    save_solution(optimize(parse_plan(_BRIEF)), solution)
    add("npz", "result.npz", load_solution, solution.read_bytes())
    cases = make_cases(_BRIEF, vary={"flight.altitude": [40, 50]})
    run_study(cases, jobs=1, directory=directory)

    def rows(path: Path) -> object:
        found = load_rows(path.parent, cases)
        return table(found), comparison(found)

    add("rows", ROWS, rows, (directory / ROWS).read_bytes())
    for ending, content in _logs().items():
        add(ending, f"flight.{ending}", _log, content)
    found["vary"] = Target("vary", _vary, _VALUES, mutate.text)
    return found


def _missions(*patterns: str) -> list[bytes]:
    """Return the small sound missions of the tests in the files of these names."""
    folders = [_DATA / "missions", _DATA / "validate"]
    paths = [path for folder in folders for pattern in patterns for path in folder.glob(pattern)]
    found = []
    for path in sorted(paths):
        if path.stat().st_size < _LARGEST_SEED:
            with suppress(MissionFileError):
                _mission(path)
                found.append(path.read_bytes())
    return found


def _logs() -> dict[str, bytes]:
    """Return the beginnings of logs by their endings."""
    logs = _DATA / "logs"
    return {
        "bin": (logs / "arducopter.bin").read_bytes()[:6000],
        "tlog": (logs / "px4.tlog").read_bytes()[:1000],
        "ulg": ulog(kept(_log(logs / "px4.tlog")[0], slice(0, 60))),
    }


def _mission(path: Path) -> object:
    """Read a mission and write it in every format."""
    mission = read_mission_file(path).mission
    return [render_files(mission, f"out{ending}") for ending in (".waypoints", ".plan", ".kml")]


def _fence(path: Path) -> object:
    """Read a fence and find the area that it leaves."""
    fence = read_fence(path)
    home = fence.polygons[0].vertices[0] if fence.polygons else (47.4, 8.5)
    return FreeArea.of(areas_of(fence, LocalFrame(*home)), any_inclusion=True)


def _log(path: Path) -> list[FlightRecord]:
    """Read a log as `read_log` does, but in this process, which says what it uses."""
    with Path(os.devnull).open("w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
        try:
            said = list(messages(path))
        except Exception as error:
            raise InputError(f"{path}: not a log: {type(error).__name__}") from None
    return [FlightRecord.of(*each) for each in flights(path, said)]


def _vary(content: bytes) -> object:
    return parse_vary(content.decode("utf-8", errors="surrogateescape"))
