"""Plans that real autopilots fly by setpoints in trouble.

    FAAO_AUTOPILOTS=FOLDER python benchmarks/disturbed.py [ardupilot | px4] [CASE ...]

The sample 30 m above the ground, in simulators twice as fast as the world. Cases: `wind`, of which
the plan knows nothing; `silence`, a link that carries nothing for 8 s of the flight; `loss 5 %` and
`loss 20 %` of all packets each way; `outages` of 2 s of the world's time, one in ten. One row for
each: how it ended, the delivered rate over the planned one, and m rms from the plan at equal times.
"""

import os
import sys
import tempfile
import time
from pathlib import Path
from unittest.mock import patch

from flown import serving

from faao_mav import Result, plan_mission
from faao_mav.fly.fly import FlightReport, fly_mission
from faao_mav.fly.preflight import Flight
from faao_mav.fly.watch import Watch
from faao_mav.plan import Wind
from faao_mav.sim.faults import Faults, FaultyTransport
from faao_mav.wire import link
from faao_mav.wire.transport import open_transport
from missions import plan_of

SPEEDUP = 2
BEGIN = 25.0
"""Seconds of the plan's clock after which the link breaks."""

OUTAGES = tuple((begin, begin + 2.0) for begin in range(15, 600, 20))
FAULTS = {
    "loss 5 %": Faults(loss=0.05, seed=1),
    "loss 20 %": Faults(loss=0.2, seed=1),
    "outages": Faults(outages=OUTAGES, seed=1),
}
AUTOPILOTS, CASES = ("ardupilot", "px4"), ("none", "wind", "silence", *FAULTS)


class Disturbance:
    """What happens to the link of a flight, as its plan's clock goes on."""

    listens, silent_until = True, 0.0

    def __init__(self, case: str) -> None:
        self.case = case

    def opened(self, text: str) -> "Disturbance | FaultyTransport":
        """Open the link."""
        self.transport = open_transport(text)
        self.close = self.transport.close
        return FaultyTransport(self, FAULTS[self.case]) if self.case in FAULTS else self

    def read(self, timeout: float) -> list[tuple[bytes, str]]:
        arrived = self.transport.read(timeout)
        return [] if time.monotonic() < self.silent_until else arrived

    def write(self, data: bytes, to: str | None = None) -> None:
        if time.monotonic() >= self.silent_until:
            self.transport.write(data, to)

    def __call__(self, watch: Watch) -> None:
        """Break the link when that is due."""
        fixes, start = watch.seen.fixes, watch.relay_start
        flies = start is not None and fixes and fixes[-1].t - start > BEGIN
        if self.case == "silence" and flies and not self.silent_until:
            self.silent_until = time.monotonic() + 8 / SPEEDUP


def flown(autopilots: Path, autopilot: str, result: Result, case: str) -> FlightReport:
    """Fly the plan of `result` by setpoints in a simulator."""
    # 7 m/s against the middle of the flight
    wind = Wind(speed=7.0 if case == "wind" else 0.0, from_degrees=225.0)
    assert result.conversion is not None
    disturbance = Disturbance(case)
    with (
        tempfile.TemporaryDirectory() as folder,
        serving(autopilots, autopilot, result, Path(folder), SPEEDUP, wind) as connection,
        patch.object(link, "open_transport", disturbance.opened),
    ):
        flight = Flight.planned(result.conversion, result.solution, streamed=True)
        return fly_mission(flight, connection, rate=10, wait=60, watching=disturbance)


def delivered(result: Result, report: FlightReport) -> str:
    """Return how the flight ended, and what it delivered of the plan."""
    ending: str = report.ending.kind if report.ending is not None else "different"
    if report.ending is not None and ending != "finished":
        ending += f" ({report.ending.text})"
    if report.relay_start is None:
        return f"{ending}, -"
    real = report.record.line(result.solution, report.relay_start).priced(result.solution)
    share = 100 * real.delivered_rate / result.solution.delivered_rate
    return f"{ending}, {share:.2f} %, {real.rms_position_error:.2f} m rms"


def main() -> None:
    """Print a row for each autopilot and case."""
    chosen, autopilots = sys.argv[1:], Path(os.environ["FAAO_AUTOPILOTS"])
    for autopilot in [each for each in AUTOPILOTS if each in chosen] or AUTOPILOTS:
        result = plan_mission(plan_of({"flight.altitude": 30}, autopilot, "recommend"))
        for case in [each for each in CASES if each in chosen] or CASES:
            report = flown(autopilots, autopilot, result, case)
            print(f"{autopilot:<10}{case:<11}{delivered(result, report)}", flush=True)


if __name__ == "__main__":
    main()
