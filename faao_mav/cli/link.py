"""`faao-mission link`: a link fitted to logs, or what terrain leaves of free space."""

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import faao_mav.cli.shared as cli
from faao_mav.errors import InputError, counted
from faao_mav.files import check_ending, read_text, write_together

if TYPE_CHECKING:
    from faao_mav.radio.fit import Samples
    from faao_mav.report.link import LinkReport


@dataclass(frozen=True, slots=True)
class _Measured:
    """What flights have measured of a link."""

    power: float | None = cli.option("DBM", "What was sent, dBm; without: shape only.")
    noise: float | None = cli.option("DBM", "Noise of the receiver, dBm: for snr.")
    rates: cli.File = cli.option(
        "TABLE.csv", "The radio's rates, as a plan has them: for throughput."
    )
    unit: list[str] | None = cli.option("COLUMN=UNIT", "The unit of a column; may be repeated.")
    calibrate: list[str] | None = cli.option(
        "COUNT=DBM", "What a device counts at a level; once or twice."
    )
    mean: float = cli.option(
        "S", "Time over which levels are averaged, s.", min=0.1, max=60.0, default=2.0
    )

    def gains(self, path: Path, station: Sequence[float]) -> "Iterator[Samples]":
        """Yield the gain, dB, in each flight of a table or log; without power within a constant."""
        import numpy as np

        from faao_mav.fly.logs import read_log
        from faao_mav.plan.reader import MAX_BESIDE, RATES, read_rates
        from faao_mav.radio.measured import read_measured
        from faao_mav.radio.rate_steps import RateSteps

        units = dict(each.partition("=")[::2] for each in self.unit or ())
        points = [
            cli.read_numbers(each, 2, f"--calibrate {each}: expected COUNT=DBM, two numbers", "=")
            for each in self.calibrate or ()
        ]
        if len(points) > 2 or len({count for count, *_ in points}) < len(points):
            raise InputError("--calibrate: expected one or two different counts")
        steps = None
        if self.rates is not None:
            text = read_text(self.rates, MAX_BESIDE, "a table", InputError)
            steps = RateSteps.of(*read_rates(text, str(self.rates), RATES[:1]).values())
        tables: list[list[Any]] = [[]]
        if path.suffix.lower() in (".bin", ".tlog", ".ulg"):
            header = ["time_s", "latitude", "longitude", "altitude_m", "rssi"]
            units = {"rssi": units.get("rssi", "raw")}  # others are of tables beside it
            tables = [
                [
                    header,
                    *zip(f.t, f.latitude, f.longitude, f.altitude - f.home, f.rssi, strict=True),
                ]
                for f in read_log(path)
                if np.isfinite(f.rssi).any()
            ]
        if not tables:
            raise InputError(f"{path}: no radio tells a level in it; expected RADIO_STATUS or RAD")
        for rows in tables:
            found = read_measured(path, station, units, points, steps, rows)
            if found.left_out and not rows:
                told = ", or at the least or the greatest rate, which tell none" if steps else ""
                lost = counted(found.left_out, "row")
                cli.note(f"{path}: left out: {lost} without a place or a level{told}")
            over_noise = found.unit == "db"
            if over_noise and (self.power is None) != (self.noise is None):
                raise InputError(f"{path}: a ratio to the noise; give both --power and --noise")
            floor = (self.noise or 0.0) * over_noise
            yield replace(found, level=found.level + floor - (self.power or 0.0))


@dataclass(frozen=True, slots=True)
class _Terrain:
    """Where no flight has measured a link: heights of the ground, and the map over them."""

    terrain: list[Path] | None = cli.option(
        "DEM", "No log: heights, .hgt or GeoTIFF; may be repeated. The map is beside --out."
    )
    frequency: float | None = cli.option("MHZ", "Over terrain: the frequency.")
    clutter: float = cli.option(
        "M", "Over terrain: the height of woods and houses.", min=0.0, max=200.0, default=0.0
    )
    heights: str = cli.option(
        "M,M",
        "Over terrain: heights of the map above the station's ground.",
        default="40,60,80,100,120",
    )
    radius: float = cli.option(
        "M", "Over terrain: how far the map goes.", min=10.0, max=50_000.0, default=1000.0
    )
    spacing: float = cli.option(
        "M", "Over terrain: steps of the map.", min=1.0, max=1000.0, default=20.0
    )

    def report(self, station: Sequence[float]) -> "LinkReport":
        """Return free space and the map of what terrain takes above it."""
        frequency, heights, paths = self.frequency, self.heights, self.terrain or ()
        if frequency is None or not 30 <= frequency <= 100_000:
            raise InputError("--frequency: expected MHz, 30 to 100000, for --terrain")
        from faao_mav.plan.sections import HIGHEST

        wanted = f"--heights {heights}: expected metres that rise, as 40,60,80"
        levels = cli.read_numbers(heights, heights.count(",") + 1, wanted)
        if list(levels) != sorted(set(levels)) or not 0 < levels[0] <= levels[-1] <= HIGHEST:
            raise InputError(wanted)
        from faao_mav.radio.terrain import read_terrain, terrain_map
        from faao_mav.report.link import over_terrain

        rasters = []
        for path in paths:
            raster, unknown = read_terrain(path)
            rasters.append(raster)
            if unknown:
                said = "heights are not known and taken from the nearest that are"
                cli.note(f"{path}: {unknown:,} {said}")
        size = self.clutter, self.radius, self.spacing
        with cli.progress() as observe:
            found = terrain_map(rasters, station, 1e6 * frequency, levels, *size, observe)
        return over_terrain(found, frequency, ", ".join(path.name for path in paths))


@cli.with_options(measured=_Measured, over=_Terrain)
def link(
    station: str = cli.option(
        "LAT,LON,HEIGHT",
        "The station's antenna: degrees, and m as the altitudes, over terrain m above ground.",
        default=...,
    ),
    logs: list[Path] | None = typer.Argument(
        None, metavar="[LOG...]", help="Flights: .csv, or .bin, .tlog, .ulg with a radio's."
    ),
    out: cli.File = cli.option("LINK.yaml", "What to write: a plan's radio.gain."),
    *,
    measured: _Measured,
    map_file: cli.File = cli.option(
        "MAP.npz", "What the law leaves of the logs, as a map above it.", "--map"
    ),
    over: _Terrain,
    report: cli.File = cli.option("PAGE.html", "Measured against fitted, on one page."),
    as_json: bool = cli.AS_JSON,
) -> None:
    """Fit the law of a link's path gain to what was measured in flight, or to terrain.

    From tables (CSV) with time, latitude, longitude, altitude and one of rsrp, rssi, snr,
    throughput; or from logs with what a telemetry radio counts, where heights are above home.
    HEIGHT of the station is above the same. The law has as many terms over the elevation as pay
    when whole legs and heights are left out of the fit; what it leaves is told as its spread, and
    by --map as a map above the law, kriged, where that tells legs that were left out better.

    With --terrain and --frequency: free space, and above it a map of minus the diffraction loss by
    ITU-R P.526, Bullington's construction. Its origin is the station's ground, which --out names.

    Exit status: 0 fitted; 1 no law holds, nothing is written but the page; 2 unusable arguments or
    input.
    """
    wanted = f"--station {station}: expected LAT,LON,HEIGHT, degrees and m"
    place = cli.read_numbers(station, 3, wanted)
    if abs(place[0]) > 90 or abs(place[1]) > 180:
        raise InputError(wanted)
    if out is not None:
        check_ending(out, "--out", (".yaml", ".yml"))
        map_file = map_file or (out.with_suffix(".npz") if over.terrain else None)
    if map_file is not None:
        check_ending(map_file, "--map", (".npz",))
        if out is None:
            raise InputError("--map: give --out, the file that names it")
    inputs = {f"LOG {path}": path for path in logs or ()}
    inputs |= {f"--terrain {path}": path for path in over.terrain or ()}
    outputs = {"--out": out, "--map": map_file, "--report": report}
    cli.check_outputs(outputs, {"--rates": measured.rates, **inputs})
    if bool(logs) == bool(over.terrain):
        raise InputError("expected LOG..., flights that were measured, or --terrain DEM")
    about_logs = ("power", "noise", "rates", "unit", "calibrate")
    given = {"--report": report} | {f"--{name}": getattr(measured, name) for name in about_logs}
    for name, value in given.items():
        if over.terrain and value is not None:
            raise InputError(f"{name}: is about logs; leave it out with --terrain")
    from faao_mav.radio.fit import fit_link
    from faao_mav.radio.map_file import map_archive
    from faao_mav.report.link import fitted, link_page
    from faao_mav.report.summary import joined

    contents: dict[str | Path, bytes] = {}
    if over.terrain:
        found = over.report(place)
    else:
        flights = [each for path in logs or () for each in measured.gains(path, place)]
        fit = fit_link(flights, measured.mean)
        found = fitted(fit, measured.power is not None, place if map_file is not None else None)
        if report is not None:
            contents[report] = link_page(fit, found).encode()
    if out is not None and (law := found.law):
        if found.above is not None and map_file is not None:
            contents[map_file] = map_archive(found.above)
            law["map"] = os.path.relpath(map_file, out.parent)
        shown = {key: json.dumps(law[key], ensure_ascii=False) for key in law}
        lines = "".join(f"{key}: {shown[key]}\n" for key in shown)
        contents[out] = lines.encode(errors="backslashreplace")
    write_together(contents)
    written = [*reversed(contents)]
    cli.show(
        lambda: found.record | {"written": written},
        lambda: [joined([*found.lines, ("files", ", ".join(map(str, written)) or "none")])],
        as_json=as_json,
        good=bool(found.law),
    )
