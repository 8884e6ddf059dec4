"""Studies: one plan with many values, schemes and seeds."""

from faao_mav.study.figure import study_figure as study_figure
from faao_mav.study.rows import StudyRow as StudyRow
from faao_mav.study.rows import as_array as as_array
from faao_mav.study.rows import load_rows as load_rows
from faao_mav.study.runner import run_study as run_study
from faao_mav.study.sweep import StudyCase as StudyCase
from faao_mav.study.sweep import make_cases as make_cases
from faao_mav.study.sweep import parse_vary as parse_vary
