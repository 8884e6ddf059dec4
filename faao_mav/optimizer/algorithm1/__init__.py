"""Algorithm 1 of the paper, as printed."""
