"""The optimiser: trajectory and precoders together, Plan -> Solution (`optimize.optimize`).

`problem` and `kinematics` turn a plan into arrays; `design` says how precoders follow a channel and
which rate counts; `rates/` has the rate of a link at every position; `search/` the flights to start
from and the upper bound; `interior/` improves a flight within its constraints; `direct` joins
these. `algorithm1` is the paper's own algorithm. `solution` is what both return, `pricing` what
else is reported about it.
"""
