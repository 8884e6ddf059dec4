"""Progress of a transfer on a terminal."""

from collections.abc import Iterator
from contextlib import contextmanager

from faao_mav.mavlink.link import Observe


@contextmanager
def transfer_progress(*, shown: bool) -> Iterator[Observe | None]:
    """Give an observer that draws a bar on standard error, or None where nothing is `shown`."""
    if not shown:
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=None)

        def observe(what: str, done: int, total: int) -> None:
            bar.update(task, description=what, completed=done, total=total or None)

        yield observe
