"""A rate and a precoder of one's own: what they deliver, and where they fly.

python own_parts.py FOLDER   (missions/ of the checkout)
"""

import sys
from pathlib import Path

import numpy as np

from faao_mav import StreamRate, optimize, read_plan, save_figure


class Adaptive(StreamRate):
    """Three quarters of the capacity of one stream, six bits at most."""

    most = 6.0

    def value(self, snr):
        """Return the rate at an SNR, linear, bit/s/Hz."""
        return self.most * (1 - np.exp(-0.75 * np.log2(1 + snr) / self.most))


def equal_power(H, power, _noise):
    """The same power on every antenna: what a radio does that knows nothing of the channel."""
    N = H.shape[-1]
    return np.broadcast_to(np.sqrt(power / N) * np.eye(N), (*H.shape[:-2], N, N))


plan = read_plan(Path(sys.argv[1]) / "copter_relay.yaml")
for name, parts in (
    ("of the alphabet", {}),
    ("adaptive", {"rate": Adaptive()}),
    ("equal power", {"precoder": equal_power}),
):
    solution = optimize(plan, **parts)
    print(f"{name}: {solution.delivered_rate:.3f} bit/s/Hz")
    save_figure(solution.plot_route(), f"route-{name.replace(' ', '-')}.svg")
