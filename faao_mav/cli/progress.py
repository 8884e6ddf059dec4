"""Progress on a terminal: one line on standard error while there is work.

Each gives an observer of the work, or None where nothing is `shown`.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from faao_mav.optimizer.solution import Observer, Progress
    from faao_mav.study import StudyRow
    from faao_mav.wire.link import Observe


@contextmanager
def optimizer_progress(*, shown: bool) -> "Iterator[Observer | None]":
    """Give an observer of the work on a plan."""
    with _line("BarColumn", "TimeElapsedColumn", "{task.description}", shown=shown) as update:

        def observe(now: "Progress") -> None:
            step = f"iteration {now.iteration} of at most {now.max_iterations}"
            best = f", {now.best_rate:.4f} bit/s/Hz" if now.best_rate else ""
            update(description=f"{step}: {now.stage}{best}")

        yield observe if shown else None


@contextmanager
def transfer_progress(*, shown: bool) -> "Iterator[Observe | None]":
    """Give an observer of a transfer to or from a vehicle."""
    with _line("{task.description}", "BarColumn", "MofNCompleteColumn", shown=shown) as update:

        def observe(what: str, done: int, total: int) -> None:
            update(description=what, completed=done, total=total or None)

        yield observe if shown else None


@contextmanager
def study_progress(total: int, *, shown: bool) -> "Iterator[Callable[[StudyRow], None] | None]":
    """Give an observer of the `total` rows of a study."""
    columns = ("BarColumn", "MofNCompleteColumn", "TimeRemainingColumn", "{task.description}")
    with _line(*columns, shown=shown) as update:
        update(total=total, description="")
        yield (lambda row: update(advance=1, description=row.scheme)) if shown else None


@contextmanager
def _line(*columns: str, shown: bool) -> Iterator[Callable[..., Any]]:
    """Give what updates the line, if one is `shown`.

    `columns` are names of classes of `rich.progress`, or templates of text.
    """
    if not shown:
        yield lambda **_: None
        return
    from rich import progress
    from rich.console import Console

    made = [
        progress.TextColumn(name) if "{" in name else getattr(progress, name)() for name in columns
    ]
    with progress.Progress(*made, console=Console(stderr=True), transient=True) as line:
        yield partial(line.update, line.add_task("starting", total=None))
