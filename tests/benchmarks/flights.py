"""Predicted against recorded flights, of both autopilots.

python tests/benchmarks/flights.py
"""

import flights_arducopter
import flights_px4
from recorded import show

if __name__ == "__main__":
    print("ArduCopter")
    show(flights_arducopter.rows())
    print("\nPX4")
    show(flights_px4.rows())
