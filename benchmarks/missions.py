"""How well missions keep their plans: predicted flights of relay plans.

    python benchmarks/missions.py [--px4] [--keep] [--random FIRST,COUNT]

One row for each plan: CPU seconds of the conversion, items with home, rms and largest position
error at equal times, path error (m), how much later than planned the flight is over (s), the
delivered rate over the planned one. Everything printed is predicted; `flights.py` says how well
predictions agree with recorded flights. `--random` draws plans from seeds instead.
"""

import argparse
import time
from pathlib import Path
from random import Random
from typing import Any

from faao_mav.optimizer.optimize import optimize
from faao_mav.plan import Plan, read_plan
from faao_mav.schedule.conversion import convert
from faao_mav.schedule.prediction import price_flight

SAMPLE = Path(__file__).parents[1] / "missions" / "copter_relay.yaml"


def changes(
    duration: float, speed: float, start: list[int], end: list[int], user: list[int], height: float
) -> dict[str, Any]:
    return {
        "flight.duration": duration,
        "vehicle.max_speed": speed,
        "flight.start": start,
        "flight.end": end,
        "radio.ground_user.position": user,
        "flight.altitude": height,
    }


PLANS: dict[str, dict[str, Any]] = {
    "copter_relay, 120 s, 8 m/s": {},
    "short, 60 s, 6 m/s": changes(60, 6, [0, 200], [200, 0], [200, 200], 100),
    "slow, 90 s, 4 m/s": changes(90, 4, [0, 150], [150, 0], [250, 250], 100),
    "two hovers, 200 s, 9 m/s": changes(200, 9, [0, 350], [350, 0], [300, 300], 100)
    | {"vehicle.max_acceleration": 2.0},
    "two hovers, 300 s, 7 m/s": changes(300, 7, [0, 350], [500, 0], [600, 500], 100),
    "curved, 100 s, 7 m/s": changes(100, 7, [0, 350], [350, 0], [350, 300], 60),
    "curved, 75 s, 8 m/s": changes(75, 8, [-50, 250], [250, -50], [300, 300], 50),
    "curved, 150 s, 8 m/s": changes(150, 8, [-200, 350], [350, -200], [400, 400], 60)
    | {"radio.relay.noise_dbm": -85, "radio.ground_user.noise_dbm": -85},
}
"""Changes of the sample plan, by dotted keys."""


def plan_of(changes: dict[str, Any], autopilot: str, parameters: str) -> Plan:
    """Return the sample plan with the dotted keys of `changes` replaced."""
    whose = {"vehicle.autopilot": autopilot, "mission.parameters": parameters}
    return read_plan(SAMPLE).changed(changes | whose)


def random_changes(seed: int) -> dict[str, Any]:
    """Return changes of the sample plan that nobody chose: 60 to 240 s at 3 to 9.5 m/s."""
    random = Random(seed)
    speed = round(random.uniform(3, 9.5), 1)
    duration = random.randrange(60, 241, 10)
    reach = min(450.0, 0.35 * speed * duration)

    def place(reach: float) -> list[int]:
        return [round(random.uniform(-reach, reach)) for _ in range(2)]

    ends = ["free" if random.random() < 0.2 else "hover" for _ in range(2)]
    start, end, height = place(reach), place(reach), random.choice((40, 60, 80, 100, 120))
    acceleration = round(random.uniform(0.8, 2.5), 1)
    return changes(duration, speed, start, end, place(500.0), height) | {
        "flight.start_velocity": ends[0],
        "flight.end_velocity": ends[1],
        "vehicle.max_acceleration": acceleration,
        "radio.modulation": random.choice(("bpsk", "qpsk", "8psk", "16qam")),
        "radio.relay.noise_dbm": random.choice((-80, -85, -91)),
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--px4", action="store_true")
    parser.add_argument("--keep", action="store_true", help="the autopilot's default parameters")
    parser.add_argument("--random", metavar="FIRST,COUNT", help="plans drawn from these seeds")
    options = parser.parse_args()
    first, count = map(int, (options.random or "0,0").split(","))
    drawn = {f"random {seed}": random_changes(seed) for seed in range(first, first + count)}
    whose = "px4" if options.px4 else "ardupilot", "keep" if options.keep else "recommend"
    print(", ".join(whose))
    print(f"{'plan':28}      s  items   rms    max   path    late    rate")
    for name, changes in (drawn or PLANS).items():
        plan = plan_of(changes, *whose)
        solution = optimize(plan)
        started = time.process_time()
        conversion = convert(solution)
        seconds = time.process_time() - started
        track = conversion.schedule.track()
        found = price_flight(solution, track["predicted_t"], track["predicted_w"])
        print(
            f"{name:28} {seconds:6.2f} {len(conversion.mission.items) + 1:6d} "
            f"{found.rms_position_error:5.2f} {found.max_position_error:6.2f} "
            f"{found.max_path_error:6.2f} {found.duration - plan.flight.duration:+7.2f} "
            f"{100 * found.delivered_rate / solution.delivered_rate:6.2f} %",
            flush=True,
        )


if __name__ == "__main__":
    main()
