"""Studies: one plan with many values, schemes and seeds."""

from faao_mav.study.rows import StudyRow, load_rows, table
from faao_mav.study.runner import run_study
from faao_mav.study.sweep import StudyCase, make_cases, parse_vary

__all__ = ["StudyCase", "StudyRow", "load_rows", "make_cases", "parse_vary", "run_study", "table"]
