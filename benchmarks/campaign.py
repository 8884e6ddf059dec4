"""Flights by setpoints and missions on the mock autopilot that meet trouble at random.

    python benchmarks/campaign.py [FLIGHTS] [FIRST]

300 of them from number 0 on take five minutes. Packets are lost, repeated, overtaken and held up,
links break, pilots take the aircraft, home is set anew, autopilots reboot, tell wrong places and
times, stand elsewhere, or would stop their motors without setpoints; companions and ground stations
talk beside them; who watches interrupts. Printed are how they ended, and of those in which
something happened that must not: a setpoint beyond the gate or across the fence, arming where it is
not allowed, an order to an aircraft that a pilot has, a hold that is given up, an end without a
name. The exit status is then 1.
"""

import sys
from collections import Counter
from pathlib import Path

sys.path += [str(Path(__file__).parents[1] / "tests" / each) for each in ("", "wire", "fly")]

from trials import Trial, flown


def main() -> int:
    """Fly them, and print what became of them."""
    given = [int(each) for each in sys.argv[1:]]
    count, first = [*given, *(300, 0)[len(given) :]]
    endings, setpoints, wrong = Counter[str](), 0, 0
    for seed in range(first, first + count):
        judge = flown(Trial.of(seed))
        endings[judge.outcome.kind if judge.outcome else ""] += 1
        setpoints += judge.setpoints
        if judge.wrong:
            wrong += 1
            print(f"{seed}: {judge.trial}: {judge.outcome}: {'; '.join(judge.wrong[:5])}")
    told = ", ".join(f"{number} {ending}" for ending, number in endings.most_common())
    print(f"{count} flights, {setpoints:,} setpoints: {told}; in {wrong} of them something wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
