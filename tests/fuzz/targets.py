"""The readers of files, as fuzzers see them."""

import os
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout, suppress
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

_SEEDS = {path.name: path.read_bytes() for path in (Path(__file__).parent / "seeds").iterdir()}
"""Sound inputs that no other test has; of plans, what follows the small one."""

_LARGEST_SEED = 5_000
"""Bytes of a mission that is mutated; chosen: small ones are read often."""

_CHANGES = {".npz": mutate.archive} | dict.fromkeys((".bin", ".tlog", ".ulg"), mutate.binary)
"""How files with these endings are mutated; others are as text."""

_VALUES = (b"flight.duration=60:120:30", b"power_dbm=-40:0:5,7", b"radio.modulation=bpsk,8psk")


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
    small, brief = SMALL.encode(), SMALL + "optimizer: {max_iterations: 1, starts: [straight]}\n"
    plans = [path.read_bytes() for path in sorted(MISSIONS.glob("*.yaml"))]
    add("plan", "plan.yaml", read_plan, small, small + _SEEDS["study.yaml"], *plans)
    add("fenced_plan", "fenced.yaml", read_plan, small + _SEEDS["fence.yaml"])
    for key, name in (("gain", "link.yaml"), ("rates", "rates.csv")):
        plan = directory / f"{key}.yaml"
        plan.write_text(f"{SMALL}  bandwidth_mhz: 20\n  {key}: {name}\n")

        def read(_: Path, plan: Path = plan) -> object:
            return read_plan(plan)

        add(key, name, read, _SEEDS[name])
    side = np.arange(3.0)
    known = GainMap(
        side, side, side[1:], np.full((2, 3, 3), -90.0), False, np.ones((3, 3)), (47, 8)
    )
    add("map", "map.npz", read_map, map_archive(known))
    add("map_table", "map.csv", read_map, _SEEDS["map.csv"])
    zones = _DATA / "fences" / "zones"
    for ending in ("kml", "geojson"):
        add(ending, f"fence.{ending}", _fence, zones.with_suffix(f".{ending}").read_bytes())
    add("wpl", "mission.waypoints", _mission, *_missions("*.waypoints", "*.txt"))
    add("qgc_plan", "mission.plan", _mission, *_missions("*.plan"))
    parameters = (_SEEDS["vehicle.param"], _SEEDS["vehicle.params"])
    add("parameters", "vehicle.param", read_parameters, *parameters)
    solution = directory / "solution.npz"
    save_solution(optimize(parse_plan(brief)), solution)
    add("npz", "result.npz", load_solution, solution.read_bytes())
    cases = make_cases(brief, vary={"flight.altitude": [40, 50]})
    run_study(cases, jobs=1, directory=directory)

    def rows(_: Path) -> object:
        found = load_rows(directory, cases)
        return table(found), comparison(found)

    kept = f"{ROWS}/{cases[0].key}.json"
    add("rows", kept, rows, (directory / kept).read_bytes())
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
