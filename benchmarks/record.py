"""Fly recorded missions again in real autopilots' simulators, and keep the thinned tracks.

    FAAO_AUTOPILOTS=FOLDER python benchmarks/record.py [arducopter | arduplane | px4 | NAME ...]

A flight NAME of tests/data/flights, or NAME-windSPEEDfromDEGREES, is that of the file
NAME.waypoints as it stands, with the parameters that are beside it or that its name tells, in calm
air or in a steady wind, m/s and degrees clockwise from north. Its track is kept every half second
and before and after a change of the current item; a plane's from a second before the end of its
take-off. A new flight has a file of its mission first, and is named here.
"""

import csv
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from flights import FLIGHTS, mission_of, names, parameters_of, wind_of
from simulators import usable

from faao_mav.plan import Wind

PERIOD = 0.5  # between the samples that are kept, s

Rows = list[dict[str, str]]


def thinned(rows: Rows) -> Iterator[dict[str, str]]:
    """Yield the rows every `PERIOD` s, and those before and after a change of the item."""
    due = float("-inf")
    for before, row, after in zip([None, *rows], rows, [*rows[1:], None], strict=False):
        change = any(each is not None and each["seq"] != row["seq"] for each in (before, after))
        if change or float(row["t_s"]) >= due:
            due = max(due, float(row["t_s"])) + (0 if change else PERIOD)
            yield row


def flown_by(runner: Path, mission: Path, options: list[str]) -> Rows:
    """Fly the file `mission` by `runner` and return the rows of its track; again if that fails."""
    with tempfile.TemporaryDirectory() as folder:
        track = Path(folder) / "track.csv"
        command = [sys.executable, str(runner), str(mission), "--out", str(track), *options]
        for _ in range(4):
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode == 0:
                with track.open() as file:
                    return list(csv.DictReader(file))
    raise SystemExit(f"{mission.stem}: not flown: {done.stdout[-2000:]}{done.stderr[-2000:]}")


def in_wind(runner: Path, wind: Wind) -> list[str]:
    """Return the option of `runner` for a steady `wind`."""
    east, north = wind.velocity
    asked = f"{east},{north}" if "px4" in runner.name else f"{wind.speed},{wind.from_degrees}"
    return [f"--wind={asked}"] if wind.speed else []


def options_of(folder: str, name: str) -> list[str]:
    """Return the options of the runner for the flight `name`, the wind aside."""
    match folder:
        case "px4":
            own = str(FLIGHTS / folder / f"{mission_of(name)}.params")
            return ["--param-file", own, "--params", "SIH_KDV=0.2", "--speedup", "10"]
        case "arduplane":
            return ["--vehicle", "plane", "--speedup", "20", "--tail", "3"]
    given = ",".join(f"{key}={value}" for key, value in parameters_of(name).items())
    return ["--speedup", "20", *(["--params", given] if given else [])]


def record(autopilots: Path, folder: str, name: str) -> None:
    """Fly the flight `name` and keep its track."""
    runner = autopilots / ("fly_px4.py" if folder == "px4" else "fly_arducopter.py")
    options = ["--hz", "20", *options_of(folder, name), *in_wind(runner, wind_of(name))]
    rows = flown_by(runner, FLIGHTS / folder / f"{mission_of(name)}.waypoints", options)
    keys = ["t_s", "lat", "lon", "alt_rel_m", "seq"]
    if folder == "arduplane":
        keys[4:4] = ["vx", "vy", "vz"]
        taken_off = next(float(row["t_s"]) for row in rows if int(row["seq"]) > 1)
        rows = [row for row in rows if float(row["t_s"]) >= taken_off - 1]
    with (FLIGHTS / folder / f"{name}.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, keys, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(thinned(rows))


def main() -> None:
    """Record the flights that are named, or all."""
    chosen = set(sys.argv[1:])
    with tempfile.TemporaryDirectory() as where:
        autopilots = usable(Path(os.environ["FAAO_AUTOPILOTS"]), Path(where))
        own = {path.name for path in autopilots.glob("px4")}  # names are those of other flights too
        for folder in ("arducopter", "arduplane", *(own | chosen & {"px4"})):
            files = {path.stem for path in (FLIGHTS / folder).glob("*.waypoints")}
            new = {name for name in chosen if mission_of(name) in files}
            for name in sorted({*names(folder), *new}):
                if not chosen or {folder, name} & chosen:
                    record(autopilots, folder, name)
                    print(name, flush=True)


if __name__ == "__main__":
    main()
