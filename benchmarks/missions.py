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
from faao_mav.plan import Plan, parse_plan
from faao_mav.plan.yaml_text import dump_yaml, load_yaml
from faao_mav.schedule.conversion import convert
from faao_mav.schedule.prediction import price_flight

SAMPLE = Path(__file__).parents[1] / "missions" / "copter_relay.yaml"

PLANS: dict[str, dict[str, Any]] = {
    "copter_relay, 120 s, 8 m/s": {},
    "short, 60 s, 6 m/s": {
        "flight.duration": 60,
        "vehicle.max_speed": 6,
        "flight.start": [0, 200],
        "flight.end": [200, 0],
        "radio.ground_user.position": [200, 200],
    },
    "slow, 90 s, 4 m/s": {
        "flight.duration": 90,
        "vehicle.max_speed": 4,
        "flight.start": [0, 150],
        "flight.end": [150, 0],
        "radio.ground_user.position": [250, 250],
    },
    "two hovers, 200 s, 9 m/s": {
        "flight.duration": 200,
        "vehicle.max_speed": 9,
        "vehicle.max_acceleration": 2.0,
    },
    "two hovers, 300 s, 7 m/s": {
        "flight.duration": 300,
        "vehicle.max_speed": 7,
        "radio.ground_user.position": [600, 500],
        "flight.end": [500, 0],
    },
    "curved, 100 s, 7 m/s": {
        "flight.duration": 100,
        "vehicle.max_speed": 7,
        "radio.ground_user.position": [350, 300],
        "flight.altitude": 60,
    },
    "curved, 75 s, 8 m/s": {
        "flight.duration": 75,
        "flight.start": [-50, 250],
        "flight.end": [250, -50],
        "flight.altitude": 50,
    },
    "curved, 150 s, 8 m/s": {
        "flight.duration": 150,
        "flight.start": [-200, 350],
        "flight.end": [350, -200],
        "flight.altitude": 60,
        "radio.ground_user.position": [400, 400],
        "radio.relay.noise_dbm": -85,
        "radio.ground_user.noise_dbm": -85,
    },
}


def plan_of(changes: dict[str, Any], autopilot: str, parameters: str) -> Plan:
    """Return the sample plan with the dotted keys of `changes` replaced."""
    data = load_yaml(SAMPLE.read_text(), "test")
    changes = changes | {"vehicle.autopilot": autopilot, "mission.parameters": parameters}
    for path, value in changes.items():
        *parents, last = path.split(".")
        section = data
        for key in parents:
            section = section[key]
        section[last] = value
    return parse_plan(dump_yaml(data))


def random_changes(seed: int) -> dict[str, Any]:
    """Return changes of the sample plan that nobody chose: 60 to 240 s at 3 to 9.5 m/s."""
    random = Random(seed)
    speed = round(random.uniform(3, 9.5), 1)
    duration = random.randrange(60, 241, 10)
    reach = min(450.0, 0.35 * speed * duration)

    def place(reach: float) -> list[int]:
        return [round(random.uniform(-reach, reach)) for _ in range(2)]

    ends = ["free" if random.random() < 0.2 else "hover" for _ in range(2)]
    return {
        "flight.duration": duration,
        "flight.start": place(reach),
        "flight.end": place(reach),
        "flight.altitude": random.choice((40, 60, 80, 100, 120)),
        "flight.start_velocity": ends[0],
        "flight.end_velocity": ends[1],
        "vehicle.max_speed": speed,
        "vehicle.max_acceleration": round(random.uniform(0.8, 2.5), 1),
        "radio.ground_user.position": place(500.0),
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
    plans = PLANS
    if options.random:
        first, count = map(int, options.random.split(","))
        plans = {f"random {seed}": random_changes(seed) for seed in range(first, first + count)}
    autopilot = "px4" if options.px4 else "ardupilot"
    parameters = "keep" if options.keep else "recommend"
    print(f"{autopilot}, {parameters}")
    print(f"{'plan':28}      s  items   rms    max   path    late    rate")
    for name, changes in plans.items():
        plan = plan_of(changes, autopilot, parameters)
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
