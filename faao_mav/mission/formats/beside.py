"""The files beside a mission that belong to it by their name: its fence, its parameters.

Whoever takes the mission takes them too. So those that a run of this program wrote say so in a
comment, and go when the mission is another one; those of other origin are not touched.
"""

from pathlib import Path

from faao_mav.errors import InputError
from faao_mav.files import check_writable


def comment_for(mission: Path) -> str:
    """Return what a file that is written beside `mission` says in its first comment."""
    return f"for {mission.name}"


def check_replaceable(beside: Path, what: str) -> None:
    """Raise `InputError` where `what`, to be written to `beside`, would replace a user's own file.

    Likewise for a file that cannot be written. To be asked before the work.
    """
    check_writable(beside)
    if beside.exists() and not _is_of_a_run(beside):
        raise InputError(
            f"{beside}: {what} to go there, but it is not of an earlier run; rename it, or give "
            "the mission another name"
        )


def remove_outdated(beside: Path) -> None:
    """Remove `beside` if an earlier run wrote it: it belongs to a mission that is gone."""
    try:
        if _is_of_a_run(beside):
            beside.unlink()
    except OSError as error:
        raise InputError(
            f"{beside}: is of an earlier mission and cannot be removed: {error.strerror}"
        ) from None


def _is_of_a_run(beside: Path) -> bool:
    """Tell by the first two lines whether this program wrote `beside` beside a mission."""
    if not beside.is_file():
        return False
    with beside.open("rb") as file:
        return any(file.readline(200).startswith(b"# for ") for _ in range(2))
