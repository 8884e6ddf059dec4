"""Print how well a fitted law tells the level of a height that it has not seen.

    python benchmarks/measured_link.py --station LAT,LON,HEIGHT FLIGHT.csv FLIGHT.csv ...

Each table is a flight at a height of its own, as `faao-mission link` reads them. Each in turn is
left out, the law is fitted to the others, and its rms error on that flight stands beside that of
d^-2, that with the map of what the law leaves of the others, and the spread that the fit told.
"""

import argparse
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from faao_mav.arrays import Real
from faao_mav.radio.fit import Samples, fit_link
from faao_mav.radio.kriging import kriged
from faao_mav.radio.measured import read_measured


def spread_out(means: Samples) -> Real:
    """The level that d^-2 has at 1 m by each of the means, dB."""
    return np.asarray(means.level + 20 * np.log10(np.linalg.norm(means.place, axis=1)))


def told(errors: Iterable[float]) -> str:
    return ", ".join(f"{error:.2f}" for error in errors)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--station", required=True)
    parser.add_argument("tables", nargs="+", type=Path)
    given = parser.parse_args()
    station = tuple(map(float, given.station.split(",")))
    flights = [read_measured(path, station) for path in given.tables]
    print("left out, law, rms error dB: law, d^-2, law and map; spread told dB")
    rows = []
    for out, flight in enumerate(flights):
        others = flights[:out] + flights[out + 1 :]
        fit, seen = fit_link(others), flight.means(2.0)
        square = [spread_out(each.means(2.0)) for each in (flight, *others)]
        errors = [seen.level - fit.gain_db(seen.place)]
        errors.append(square[0] - np.mean(np.concatenate(square[1:])))
        found, *_ = kriged(fit, station)
        above = found.at(float(np.median(seen.place[:, 2]))) if found else None
        errors.append(errors[0] - (above.value(*seen.place.T[:2]) if above else 0.0))
        rows.append([float(np.sqrt(np.mean(error**2))) for error in errors])
        law = f"n {fit.exponent:.2f}, {len(fit.elevation_db)} terms"
        print(f"{flight.source}: {law}: {told(rows[-1])}; {fit.spread_db:.2f}")
    mean, worst = np.mean(rows, axis=0), np.max(rows, axis=0)
    print(f"mean {told(mean)}; at most {told(worst)}")


if __name__ == "__main__":
    main()
