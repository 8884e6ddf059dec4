"""Progress on a terminal: one line on standard error while there is work."""

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
    """Give an observer of the work on a plan, or None where nothing is `shown`."""
    columns = ("BarColumn", "TimeElapsedColumn", "{task.description}")
    with _line(columns, shown=shown, first="starting", total=None) as update:

        def observe(now: "Progress") -> None:
            step = f"iteration {now.iteration} of at most {now.max_iterations}"
            best = f", {now.best_rate:.4f} bit/s/Hz" if now.best_rate else ""
            update(description=f"{step}: {now.stage}{best}")

        yield observe if shown else None


@contextmanager
def transfer_progress(*, shown: bool) -> "Iterator[Observe | None]":
    """Give an observer of a transfer to or from a vehicle, or None where nothing is `shown`."""
    columns = ("{task.description}", "BarColumn", "MofNCompleteColumn")
    with _line(columns, shown=shown, first="starting") as update:

        def observe(what: str, done: int, total: int) -> None:
            update(description=what, completed=done, total=total or None)

        yield observe if shown else None


@contextmanager
def study_progress(total: int, *, shown: bool) -> "Iterator[Callable[[StudyRow], None] | None]":
    """Give an observer of the `total` rows of a study, or None where nothing is `shown`."""
    columns = ("BarColumn", "MofNCompleteColumn", "TimeRemainingColumn", "{task.description}")
    with _line(columns, shown=shown, total=total) as update:

        def observe(row: "StudyRow") -> None:
            update(advance=1, description=row.scheme)

        yield observe if shown else None


@contextmanager
def _line(
    columns: tuple[str, ...],
    *,
    shown: bool,
    first: str = "",
    total: float | None = None,
) -> Iterator[Callable[..., Any]]:
    """Give what updates the line, if one is `shown`.

    `columns` are names of classes of `rich.progress`, or templates of text, `first` the first text.
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
        yield partial(line.update, line.add_task(first, total=total))
