"""The radio link of the relay, from bits to rates: (1) to (8) of the paper.

- ``constellation``: the alphabets, and the differences between their vectors merged into classes;
- ``gain``: the law of the path gain, and its field over the map; ``gain_map``, ``map_file``: maps
  of it; ``fit``, ``kriging``, ``terrain``: from what laws and maps are made;
- ``channel``: line of sight and fading, (1) and (2);
- ``rate``: the rate that counts by its name, and the cutoff rate, (7) and (8);
- ``mutual_information``: the mutual information, (5) and (6), at fixed noises;
- ``precoder``: the classical linear precoders and the optimum for BPSK on two antennas;
- ``best_precoder``: the precoders of highest rate, one per channel or one for many draws.

Everything is in linear SI units and vectorised over time slots, which lead every array's axes.
Another alphabet is an entry of ``constellation._GRIDS``, another linear precoder a function in
``precoder`` and an entry of ``SCHEMES``; its name joins those of the key in ``plan/``.
"""
