"""The global part of the search: the flights it starts from, and the bound on every flight.

The problem is not concave: the interior-point method finds the local optimum near its start.

- `sweep`: dynamic programming over the map, by position alone.
- `starts`: feasible flights to start from, straight and by way of the stations, inside a fence or
  not, made by `straight`; all of them improved roughly, and those chosen to improve to the end.
- `bound`: an upper bound on what is maximised, over all flights and precoders: by `map_bound`
  (a price on both hops and a sweep) or by place and speed along the line of the stations, over the
  `best_rates` of the links. Its distance to a solution's rate is what a better local optimum could
  gain at most.
"""
