"""The paper's figures 3 and 4: routes for three durations, rate against power by scheme.

python paper_figures.py FOLDER   (missions/ of the checkout; some minutes)
"""

import sys
from pathlib import Path

from faao_mav import make_cases, read_plan, run_study, save_figure, study_figure

missions = Path(sys.argv[1])
for name in ("paper_fig3", "paper_fig4"):
    plan = read_plan(missions / f"{name}.yaml")
    asked = plan.study
    cases = make_cases(plan.text, vary=asked.vary, schemes=asked.schemes, seeds=asked.seeds)
    rows = run_study(cases)
    save_figure(study_figure(rows, plan, asked.figure), f"{name}.svg")
    print(f"{name}.svg: {len(rows)} cases")
