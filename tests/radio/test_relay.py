"""The relay's queue, against linear programs that know nothing of it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import linprog

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.radio.relay import RelayQueue, best_shares, forward_greedily

BITS = st.integers(0, 64).map(lambda k: k / 16)
BUFFERS = st.sampled_from([0.5, 1.0, 3.0, math.inf])


@st.composite
def routes(draw: st.DrawFn) -> tuple[Real, Real]:
    """Both hops' rates along a flight of up to 12 slots."""
    n = draw(st.integers(1, 12))
    I_U, I_G = (draw(arrays(float, n, elements=BITS)) for _ in range(2))
    return I_U, I_G


def most(I_U: Real, I_G: Real, buffer: float, *, half: bool) -> float:
    """The greatest delivered rate by the constraints as they are written, slot by slot."""
    n = len(I_U)
    cost = np.concatenate([np.zeros(n), -np.ones(n)]) / n
    rows, bounds = [], []
    for k in range(n + 1):
        came = np.concatenate([np.arange(n) < k, np.zeros(n)])
        left_before = np.concatenate([np.zeros(n), np.arange(n) < k])
        if k < n:  # f_k <= q_k
            this = np.eye(2 * n)[n + k]
            rows.append(this - came + left_before)
            bounds.append(0.0)
        if math.isfinite(buffer) and k < n:
            rows.append(came - left_before)
            bounds.append(buffer)
    if half:
        for k in range(n):
            if I_U[k] > 0 and I_G[k] > 0:
                rows.append(np.eye(2 * n)[k] / I_U[k] + np.eye(2 * n)[n + k] / I_G[k])
                bounds.append(1.0)
    limits = [(0.0, float(x)) for x in np.concatenate([I_U, I_G])]
    found = linprog(cost, A_ub=np.array(rows), b_ub=bounds, bounds=limits)
    assert found.fun is not None
    return -float(found.fun)


@given(routes(), BUFFERS)
def test_greedy_forwarding_is_the_best_in_full_duplex(
    route: tuple[Real, Real], buffer: float
) -> None:
    I_U, I_G = route
    relayed = forward_greedily(I_U, I_G, buffer)
    for least, most_of_it in (
        (0, relayed.received),
        (relayed.received, I_U),
        (0, relayed.forwarded),
        (relayed.forwarded, np.minimum(I_G, relayed.queue)),
        (relayed.queue, buffer + 1e-12),
    ):
        assert (np.asarray(least) <= most_of_it).all()
    assert relayed.queue[0] == 0
    assert np.diff(relayed.queue) == pytest.approx((relayed.received - relayed.forwarded)[:-1])
    assert relayed.rate == pytest.approx(most(I_U, I_G, buffer, half=False), abs=1e-9)


@given(routes(), BUFFERS)
def test_best_shares_are_those_of_the_program(route: tuple[Real, Real], buffer: float) -> None:
    relayed = RelayQueue(half=True, buffer=buffer).relayed(*route, 1.0)
    assert relayed.rate == pytest.approx(most(*route, buffer, half=True), abs=1e-7)


def test_a_long_hover_has_rates_that_are_equal_but_for_rounding() -> None:
    n, u, g = 1000, 1.39, 0.63
    noise = 1 + 1e-15 * np.random.default_rng(1).standard_normal((2, n))
    I_U, I_G = u * noise[0], g * noise[1]
    rate = RelayQueue(half=True).relayed(I_U, I_G, 1.0).rate
    assert rate == pytest.approx(u * g / (u + g), abs=1 / n)


def test_what_no_relay_has_is_refused() -> None:
    two = np.ones(2)
    for I_U, I_G, buffer in (
        (np.ones(3), two, 1.0),
        (np.ones(0), np.ones(0), 1.0),
        (-two, two, 1.0),
        (math.nan * two, two, 1.0),
        (two, two, 0.0),
        (two, two, math.nan),
    ):
        for forwarded in (forward_greedily, best_shares):
            with pytest.raises(InputError, match=r"expected"):
                forwarded(I_U, I_G, buffer)
