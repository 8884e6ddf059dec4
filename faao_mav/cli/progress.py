"""Progress of the optimiser on a terminal."""

from collections.abc import Iterator
from contextlib import contextmanager

from faao_mav.optimizer.solution import Observer, Progress


@contextmanager
def progress(*, shown: bool) -> Iterator[Observer | None]:
    """Give an observer that draws a line on standard error, or None where nothing is `shown`."""
    if not shown:
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress as Line
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Line(*columns, console=Console(stderr=True), transient=True) as line:
        task = line.add_task("starting", total=None)

        def observe(now: Progress) -> None:
            line.update(
                task,
                description=f"iteration {now.iteration} of at most {now.max_iterations}: "
                f"{now.stage}, best {now.best_rate:.4f} bit/s/Hz",
            )

        yield observe
