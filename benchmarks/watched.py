"""Missions that real autopilots fly under the eyes of `fly --arm`, and what their own logs say.

    FAAO_AUTOPILOTS=FOLDER python benchmarks/watched.py [ardupilot | px4] [PLAN ...]

The plans of `flown.py`, in calm air. One row for each: how watching ended, rms position error at
equal times (m), and the delivered rate over the planned one, as the watcher saw them and by
the autopilot's own log; in percent, the greatest difference between the two of the delivered rate
and of the rates of both hops; the processor time of the debriefing, s.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

from flown import FLOWN, serving

from faao_mav import Result, plan_mission
from faao_mav.fly.fly import Telling, fly_mission
from faao_mav.fly.logs import read_log
from faao_mav.fly.preflight import Flight
from faao_mav.report.debrief import FromLog
from faao_mav.validate.flown import Debriefing
from missions import plan_of

AUTOPILOTS = ("ardupilot", "px4")


def watched(autopilots: Path, autopilot: str, result: Result, folder: Path) -> str:
    """Have the mission of `result` flown and watched; return the cells of its row."""
    assert result.conversion is not None
    assert result.check is not None
    telling = Telling(result.solution, result.check.track, None, lambda _: None)
    with serving(autopilots, autopilot, result, folder, speedup=10) as connection:
        flight = Flight.planned(result.conversion, result.solution)
        report = fly_mission(flight, connection, arm=True, wait=60, watching=telling)
    seen, ending = telling.debriefing(report), report.ending
    if ending is None or seen is None:
        return f"not flown: {ending}"
    share = 100 * seen.flown.delivered_rate / result.solution.delivered_rate
    cells = [f"{ending.kind:<10}{seen.flown.rms_position_error:5.2f} {share:7.2f} %"]
    logs = [path for path in folder.rglob("*") if path.suffix in {".BIN", ".ulg"}]
    logs.sort(key=lambda path: path.stat().st_size)
    begun = time.process_time()
    own = FromLog.of(read_log(logs[-1]), result, logs[-1].name).found
    share = 100 * own.flown.delivered_rate / result.solution.delivered_rate
    cells.append(f"{own.flown.rms_position_error:5.2f} {share:7.2f} %")
    apart = max(abs(here / there - 1) for here, there in zip(rates(own), rates(seen), strict=True))
    return "   ".join([*cells, f"{100 * apart:.3f} %   {time.process_time() - begun:.1f} s"])


def rates(found: Debriefing) -> tuple[float, float, float]:
    """Return what was delivered, and the rates of both hops, bit/s/Hz."""
    flown = found.flown
    return flown.delivered_rate, flown.rates.R_U, flown.rates.R_G


def main() -> None:
    """Print the table."""
    chosen, autopilots = sys.argv[1:], Path(os.environ["FAAO_AUTOPILOTS"])
    for autopilot in [each for each in AUTOPILOTS if each in chosen] or AUTOPILOTS:
        for name in [each for each in FLOWN if each in chosen] or FLOWN:
            result = plan_mission(plan_of(FLOWN[name], autopilot, "recommend"))
            with tempfile.TemporaryDirectory() as folder:
                told = watched(autopilots, autopilot, result, Path(folder))
            print(f"{autopilot:<10}{name:<28}{told}", flush=True)


if __name__ == "__main__":
    main()
