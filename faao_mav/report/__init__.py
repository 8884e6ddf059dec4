"""Figures, the page that tells of a flight without a network, and the lines that both say."""

from pathlib import Path

from faao_mav.files import write_whole
from faao_mav.report.summary import summary as summary
from faao_mav.workflow import Result


def write_part(result: Result, part: str, path: Path) -> None:
    """Write the `part` "save", "precoders", "report" or "figure" of `result` to the file `path`.

    Raises `InputError` where it cannot be written, and for precoders that are no table.
    """
    solution, conversion = result.solution, result.conversion
    match part:
        case "save":
            from faao_mav.optimizer.solution import save_solution

            save_solution(solution, path, conversion.schedule.track() if conversion else None)
        case "precoders":
            from faao_mav.schedule.precoder_table import precoder_table

            write_whole(path, precoder_table(solution).encode())
        case "report":
            from faao_mav.report.page import render_report

            write_whole(path, render_report(result).encode())
        case "figure":
            from faao_mav.report.figures import flight_figure
            from faao_mav.report.style import save_figure

            save_figure(flight_figure(solution, conversion, result.prediction), path)
