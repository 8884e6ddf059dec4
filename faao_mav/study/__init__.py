"""Studies: one plan with many values, schemes and seeds."""

from faao_mav.study.rows import Row, load_rows, table
from faao_mav.study.runner import run_study
from faao_mav.study.sweep import Case, make_cases, parse_vary

__all__ = ["Case", "Row", "load_rows", "make_cases", "parse_vary", "run_study", "table"]
