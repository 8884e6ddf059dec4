"""`--report` and `--figure` of the main job."""

from pathlib import Path
from typing import TYPE_CHECKING

from faao_mav.errors import InputError
from faao_mav.files import write_whole

if TYPE_CHECKING:
    from faao_mav.cli.summary import Result


def check_names(report: Path | None, figure: Path | None) -> None:
    """Raise `InputError` for names whose ending says another format."""
    if report is not None and report.suffix not in (".html", ".htm"):
        raise InputError(f"--report {report}: give a name that ends in .html")
    if figure is not None:
        from faao_mav.report.style import check_figure_path

        check_figure_path(figure, "--figure")


def write(report: Path | None, figure: Path | None, result: "Result") -> None:
    """Write the page and the figure of `result`, where asked for."""
    solution, conversion, prediction = result.solution, result.conversion, result.prediction
    if report is not None:
        from faao_mav.report import ReportData, render_report

        page = render_report(
            ReportData(
                solution,
                conversion,
                prediction,
                result.findings,
                vehicle=conversion.vehicle,
                information=result.information,
                fresh=result.fresh,
                saturation=result.saturation,
                bound=result.bound,
            )
        )
        write_whole(report, page.encode())
    if figure is not None:
        from faao_mav.report.figures import flight_figure
        from faao_mav.report.style import save_figure

        save_figure(flight_figure(solution, conversion, prediction), figure)
