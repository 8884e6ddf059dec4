"""The interior-point method: the best flight through smooth rewards, within its constraints.

    maximise  min_j F_j(w),  F_j(w) = (1 / n) sum_n f_jn(w_n)  under (11), (12), (13d)-(13f)

or what a relay's `queue` delivers of two rates f_0n, f_1n, and whatever `Constraint`s are given.
f (rates of links, for example) may be non-concave: the method finds a local optimum near its
start, which it never falls below.

Method. All there is are inequalities g(x_n) >= 0 of the unknowns of a slot (position, velocity,
acceleration, and those of the queue) or of their sums, and linear equations from slot to slot. It
is a primal-dual method whose barrier parameter mu waits for the iterates; inequalities that a start
does not keep with room to spare are widened by a margin that is driven to zero. A Newton step is
one banded LU. Of the curvature of the Lagrangian as much counts as leaves the model convex, by
Cholesky factors; where the functions are then worse than modelled, a proximal term shortens the
step. Repeated short steps mean that the iterates hug the limits: then the multipliers are centred
anew.

Files: `maximize` is the entry; `search` iterates, `newton` takes one step; `rewards` are what is
maximised, `limits` what is kept. To add a constraint is to write one class: see `constraint`.

Units inside: lengths in 100 m, speeds in v_max, accelerations in a_max, rewards summed over the
slots and divided by the largest gradient at the start.

Why not a library: CasADi + IPOPT takes 9 to 68 times as long for the same optimum on five plans of
250 to 10,000 slots (benchmarks/direct_against_ipopt.py), and Clarabel solves convex problems only.
"""
