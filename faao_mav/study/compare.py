"""The rows of a study side by side: mean and spread over seeds."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean, stdev

from faao_mav.study.rows import Row
from faao_mav.study.sweep import Value


@dataclass(frozen=True, slots=True)
class Spread:
    """Mean and standard deviation (0 of a single seed) of R_avg, bit/s/Hz, over `count` seeds."""

    mean: float
    deviation: float
    count: int


def spreads(rows: Sequence[Row]) -> dict[tuple[tuple[Value, ...], str], Spread | None]:
    """Return the spread of R_avg over seeds by values and scheme, in order; None: all failed."""
    groups: dict[str, tuple[tuple[tuple[Value, ...], str], list[float]]] = {}
    for row in rows:
        place = (tuple(row.values.values()), row.scheme)
        _, rates = groups.setdefault(json.dumps(place), (_hashable(place), []))
        if row.R_avg is not None:
            rates.append(row.R_avg)
    return {
        place: Spread(fmean(rates), stdev(rates) if len(rates) > 1 else 0.0, len(rates))
        if rates
        else None
        for place, rates in groups.values()
    }


def _hashable(place: tuple[tuple[Value, ...], str]) -> tuple[tuple[Value, ...], str]:
    """Positions are lists in a plan; tuples can be looked up."""
    values, scheme = place
    return tuple(tuple(v) if isinstance(v, list) else v for v in values), scheme


def comparison(rows: Sequence[Row]) -> str:
    """Return a table for people: values down, schemes across, mean and spread of R_avg."""
    varied = list(dict.fromkeys(key for row in rows for key in row.values))
    schemes = list(dict.fromkeys(row.scheme for row in rows))
    found = spreads(rows)
    lines = [[*(key.rsplit(".", 1)[-1] for key in varied), *schemes]]
    for values in dict.fromkeys(values for values, _ in found):
        cells = (_cell(found.get((values, scheme))) for scheme in schemes)
        lines.append([*(json.dumps(v).strip('"') for v in values), *cells])
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    text = ["R_avg, bit/s/Hz"]
    text += [
        "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
        for line in lines
    ]
    failed = [row for row in rows if row.error]
    if failed:
        text.append(f"{len(failed)} of {len(rows)} rows failed, first: {failed[0].error}")
    loose = sum(row.converged is False for row in rows)
    if loose:
        text.append(f"{loose} of {len(rows)} rows did not converge")
    return "\n".join(text)


def _cell(spread: Spread | None) -> str:
    if spread is None:
        return "-"
    return f"{spread.mean:.4f}" + (f" +- {spread.deviation:.4f}" if spread.count > 1 else "")
