"""What an optimiser tells while it works."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Progress:
    """Where the optimiser stands: R_avg of the best iterate so far, and what runs now."""

    iteration: int
    max_iterations: int
    stage: str
    best_rate: float


Observer = Callable[[Progress], None]
