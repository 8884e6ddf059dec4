"""`--report` and `--figure` of the main job."""

from pathlib import Path
from typing import TYPE_CHECKING

from faao_mav.errors import InputError
from faao_mav.files import write_whole

if TYPE_CHECKING:
    from faao_mav.faao.solution import Solution
    from faao_mav.mission.convert import Conversion
    from faao_mav.mission.prediction import Prediction
    from faao_mav.mission.validate import Finding


def check_names(report: Path | None, figure: Path | None) -> None:
    """Raise `InputError` for names whose ending says another format."""
    if report is not None and report.suffix not in (".html", ".htm"):
        raise InputError(f"--report {report}: give a name that ends in .html")
    if figure is not None:
        from faao_mav.report.style import check_figure_path

        check_figure_path(figure, "--figure")


def write(
    report: Path | None,
    figure: Path | None,
    solution: "Solution",
    conversion: "Conversion",
    prediction: "Prediction",
    findings: "tuple[Finding, ...]",
) -> None:
    """Write the page and the figure, where asked for."""
    if report is not None:
        from faao_mav.report import ReportData, render_report

        page = render_report(ReportData(solution, conversion, prediction, findings))
        write_whole(report, page.encode())
    if figure is not None:
        from faao_mav.report.figures import flight_figure
        from faao_mav.report.style import save_figure

        save_figure(flight_figure(solution, conversion, prediction), figure)
