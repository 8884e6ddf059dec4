"""Figures, the page that tells of a flight without a network, and the lines that both say."""

from faao_mav.report.page import render_report as render_report
from faao_mav.report.summary import summary as summary
