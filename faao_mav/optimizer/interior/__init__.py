"""The interior-point method: the best flight through smooth rewards, within its constraints.

    maximise  min_j F_j(w),  F_j(w) = (1 / n) sum_n f_jn(w_n)  under (11), (12), (13d)-(13f)

or what a relay's `queue` delivers of two rates f_0n, f_1n, and whatever `Constraint`s are given.
f (rates of links, for example) may be non-concave: the method finds a local optimum near its
start, which it never falls below.

Method. Primal-dual, with a predictor and a corrector (Mehrotra). The limits on ||v_n|| and ||a_n||
are second-order cones with Nesterov-Todd scaling; t <= F_j is the barrier -mu c sum_j log(F_j - t)
with t at its optimum at every iterate. A Newton step is one banded LU. Constraints that a start
does not keep with room to spare are widened by a margin that is driven to zero. Where the curvature
of sum_j lambda_j f_j has the wrong sign for a maximum it is cut to zero; where the rewards are then
worse than modelled, a proximal term shortens the step. Repeated short steps mean that the iterates
hug the limits: then the multipliers are centred anew.

Lifecycle. `maximize.maximize` (or `maximize_all`, from many starts side by side) builds a
`search.Search`: it scales the rewards (`rewards`), lays out the Newton matrix (`banded`) and lets
every constraint begin its state. Per iteration: measure the residual, factor (`newton`), predict,
choose the barrier parameter mu, correct, move. At the end the speeds are integrated to a flight
that is exact in (11), (12) and (13d). With a least speed the limits have curvature (`min_speed`):
iterates may break them until the end, mu waits for them, and no multipliers are centred anew.

Units inside: lengths in 100 m, speeds in v_max, accelerations in a_max, rewards summed over the
slots and divided by the largest gradient at the start.

To add a constraint, write one file here and hand its objects to `maximize(constraints=...)`:

- on every slot's position, speed or acceleration: a subclass of `half_planes.HalfPlanes` that says
  which (`quantity`) and what g(x) >= 0 is (`slack`); see `fence`, which has several inequalities in
  every slot, and `min_speed`, where g has curvature.
- anything else, with unknowns of its own too: a `constraint.Constraint` and its `State`. `unknowns`
  says how many a slot has, `entries` what never changes of their rows in the banded matrix,
  `State.stiffness` what does, `State.push` their right-hand sides. tests/optimizer/
  test_constraints.py has a running sum like a queue.

Why not a library: CasADi + IPOPT takes 9 to 68 times as long for the same optimum on five plans of
250 to 10,000 slots (benchmarks/direct_against_ipopt.py: 0.47 s against 0.05 s at 250, 8.6 s
against 0.6 s at 10,000), and Clarabel solves convex problems only.
"""
