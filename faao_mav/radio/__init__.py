"""The radio link of the relay.

- ``constellation``: the alphabets, and the differences between their vectors merged into classes;
- ``channel``: path gain, line of sight, fading, (1) and (2);
- ``rate``: the cutoff rate, (7) and (8);
- ``mutual_information``: the rate itself, (5) and (6);
- ``precoder``: the classical linear precoders and the optimum for BPSK on two antennas.

Everything is in linear SI units and vectorised over time slots, which lead every array's axes.
"""
