"""`faao-mission link LOG... --station LAT,LON,HEIGHT --out link.yaml`: a link fitted to logs."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from faao_mav.cli.shared import (
    AsJson,
    File,
    Number,
    check_outputs,
    exit_status,
    note,
    option,
    read_numbers,
    show,
)
from faao_mav.errors import InputError
from faao_mav.files import check_ending, read_text, write_whole

if TYPE_CHECKING:
    from faao_mav.radio.fit import Samples
    from faao_mav.radio.measured import Calibration


@exit_status()
def link(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...", help="Flights: .csv, or .bin, .tlog, .ulg with a radio's."
        ),
    ],
    station: Annotated[
        str, option("LAT,LON,HEIGHT", "The station's antenna: degrees, and m as the altitudes.")
    ],
    out: Annotated[File, option("LINK.yaml", "What to write: a plan's radio.gain.")] = None,
    power: Annotated[Number, option("DBM", "What was sent, dBm; without: shape only.")] = None,
    noise: Annotated[Number, option("DBM", "Noise of the receiver, dBm: for snr.")] = None,
    rates: Annotated[
        File, option("TABLE.csv", "The radio's rates, as a plan has them: for throughput.")
    ] = None,
    unit: Annotated[
        list[str] | None, option("COLUMN=UNIT", "The unit of a column; may be repeated.")
    ] = None,
    calibrate: Annotated[
        list[str] | None, option("COUNT=DBM", "What a device counts at a level; once or twice.")
    ] = None,
    mean: Annotated[
        float, option("S", "Time over which levels are averaged, s.", min=0.1, max=60.0)
    ] = 2.0,
    report: Annotated[File, option("PAGE.html", "Measured against fitted, on one page.")] = None,
    as_json: AsJson = False,
) -> None:
    """Fit the law of a link's path gain to what was measured in flight.

    From tables (CSV) with time, latitude, longitude, altitude and one of rsrp, rssi, snr,
    throughput; or from logs with what a telemetry radio counts, where heights are above home.
    HEIGHT of the station is above the same. The law has as many terms over the elevation as pay
    when whole legs and heights are left out of the fit; what it leaves is told as its spread.

    Exit status: 0 fitted; 1 no law holds, nothing is written but the page; 2 unusable arguments or
    input.
    """
    wanted = f"--station {station}: expected LAT,LON,HEIGHT, degrees and m"
    place = read_numbers(station, 3, wanted)
    if abs(place[0]) > 90 or abs(place[1]) > 180:
        raise InputError(wanted)
    units = {}
    for each in unit or []:
        column, _, told = each.partition("=")
        units[column] = told
        if not told:
            raise InputError(f"--unit {each}: expected COLUMN=UNIT, as in rssi=dbm")
    points = [
        read_numbers(each, 2, f"--calibrate {each}: expected COUNT=DBM, two numbers", "=")
        for each in calibrate or []
    ]
    if len(points) > 2 or len({count for count, *_ in points}) < len(points):
        raise InputError("--calibrate: expected one or two different counts")
    inputs: dict[str, Path | None] = {"--rates": rates, **{f"LOG {path}": path for path in logs}}
    if out is not None:
        check_ending(out, "--out", (".yaml", ".yml"))
    check_outputs({"--out": out, "--report": report}, inputs)
    from faao_mav.radio.fit import fit_link
    from faao_mav.report.link import link_lines, link_page, link_record, link_yaml
    from faao_mav.report.summary import joined

    sent = power or 0.0
    flights: list[Samples] = []
    for path in logs:
        for samples, told in _flights(path, place, units, points):
            if told == "mbit/s":
                samples, told = _by_rates(path, samples, rates), "db"
            if told == "db" and (power is None) != (noise is None):
                raise InputError(f"{path}: a ratio to the noise; give both --power and --noise")
            floor = noise or 0.0 if told == "db" else 0.0
            flights.append(replace(samples, level=samples.level + floor - sent))
    absolute = power is not None
    fit = fit_link(flights, mean)
    if report is not None:
        write_whole(report, link_page(fit, absolute).encode())
    if out is not None and fit.holds:
        write_whole(out, link_yaml(fit, absolute).encode())
    written = [str(each) for each in (out if fit.holds else None, report) if each is not None]
    lines = [*link_lines(fit, absolute), ("files", ", ".join(written) or "none")]
    record = link_record(fit, absolute) | {"written": written}
    show(lambda: record, lambda: [joined(lines)], as_json=as_json)
    if not fit.holds:
        raise typer.Exit(1)


def _flights(
    path: Path,
    station: Sequence[float],
    units: Mapping[str, str],
    calibration: "Calibration",
) -> Iterator[tuple["Samples", str]]:
    """Yield the flights in a table or log, and the unit of what was measured."""
    import numpy as np

    from faao_mav.radio.measured import level_of, read_measured, samples_at

    if path.suffix.lower() not in (".bin", ".tlog", ".ulg"):
        found = read_measured(path, station, units, calibration)
        if found.left_out:
            note(f"{path}: {found.left_out} rows without a number are left out")
        yield found.samples, found.unit
        return
    from faao_mav.fly.logs import read_log

    told = [record for record in read_log(path) if np.isfinite(record.rssi).any()]
    if not told:
        raise InputError(f"{path}: no radio tells a level in it; expected RADIO_STATUS or RAD")
    for record in told:
        known = np.isfinite(record.rssi)
        level, unit = level_of(path, record.rssi[known], units.get("rssi", "raw"), calibration)
        t, up = record.t[known], (record.altitude - record.home)[known]
        where = record.latitude[known], record.longitude[known]
        yield samples_at(path, station, t, *where, up, level), unit


def _by_rates(path: Path, samples: "Samples", rates: Path | None) -> "Samples":
    """Return a throughput, Mbit/s, as the SNR, dB, at which the radio has that rate.

    What is below the lowest rate or not below the highest may be of any SNR, and is left out.
    """
    import numpy as np

    from faao_mav.plan.beside import MAX_CHARACTERS, read_rates
    from faao_mav.radio.rate_steps import RateSteps

    if rates is None:
        raise InputError(f"{path}: a throughput; give --rates, the table of the radio's rates")
    columns = read_rates(read_text(rates, MAX_CHARACTERS, "a table", InputError), str(rates))
    if "mbit_per_s" not in columns:
        raise InputError(f"{rates}: no column mbit_per_s, which a throughput needs")
    steps = RateSteps.of(columns["snr_db"], columns["mbit_per_s"])
    told = np.where(samples.level < steps.most, samples.level, np.nan)
    snr = np.interp(told, steps.rates, steps.snr_db, left=np.nan)
    if lost := int(np.sum(~np.isfinite(snr))):
        note(f"{path}: {lost} rows at the least or the greatest rate tell no SNR and are left out")
    return replace(samples, level=snr)
