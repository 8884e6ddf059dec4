"""Figures, and the page that tells of a flight without a network."""

from faao_mav.report.data import ReportData
from faao_mav.report.page import render_report

__all__ = ["ReportData", "render_report"]
