"""The global part of the search: the flights it starts from, and the bound on every flight.

The problem is not concave: the interior-point method finds the local optimum near its start.

- `starts`: feasible flights to start from, straight and by way of the stations; `cruise` makes them
  for aircraft with a least speed. A new start is a name in the plan's `optimizer.starts` and a
  branch of `starts.starts`.
- `multistart`: improves all of them roughly and chooses those to improve to the end.
- `bound`: an upper bound on R_avg over all flights and precoders, by a convex relaxation. Its
  distance to a solution's R_avg is what a better local optimum could gain at most.
"""
