"""How transfers fare by loss rate, on a simulated clock: `python benchmarks/links.py`.

A mission is uploaded to each mock autopilot and read back, over links that lose packets both ways,
from several seeds. Times are means in seconds; "sent" are items and requests for items per item of
the mission, by us and by the vehicle.
"""

import argparse
import sys
from pathlib import Path
from statistics import fmean

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "wire"))

from stations import mock_of, rows_for, there_and_back, upload_to

from faao_mav.sim import MockKind
from faao_mav.sim.faults import Faults

KINDS: tuple[MockKind, ...] = ("px4", "ardupilot")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--items", type=int, default=600)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--round-trip", type=float, default=0.004, help="s")
    parser.add_argument("--rate", type=float, default=0.0, help="bytes/s; 0: any")
    parser.add_argument("--loss", type=float, nargs="+", default=[0.0, 0.05, 0.2, 0.4])
    options = parser.parse_args()
    print("| mock | loss | verified | upload, s | sent: us, it | read, s | sent: us, it |")
    print("|---|---|---|---|---|---|---|")
    for kind in KINDS:
        for loss in options.loss:
            verified, courses = 0, []
            for seed in range(options.seeds):
                faults = Faults(
                    loss=loss, latency=options.round_trip / 2, rate=options.rate, seed=seed
                )
                report, _ = upload_to(mock_of(kind), rows_for(kind, options.items), faults)
                verified += report is not None and report.verified
                courses.append(there_and_back(kind, options.items, faults))
            cells = [kind, f"{loss:.0%}", f"{verified}/{options.seeds}"]
            for way in zip(*courses, strict=True):
                ours, theirs = (
                    fmean(getattr(course, who) for course in way) / options.items
                    for who in ("ours", "theirs")
                )
                cells += [
                    f"{fmean(course.took for course in way):.2f}",
                    f"{ours:.2f}, {theirs:.2f}",
                ]
            print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
