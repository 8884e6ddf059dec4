"""Figures, the page that tells of a flight without a network, and the lines that both say."""

from faao_mav.report.summary import summary as summary
