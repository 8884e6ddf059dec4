"""Predicted against recorded flights, of all three autopilots.

python benchmarks/flights.py
"""

import flights_arducopter
import flights_arduplane
import flights_px4
from recorded import show

if __name__ == "__main__":
    print("ArduCopter")
    show(flights_arducopter.rows())
    print("\nArduPlane")
    show(flights_arduplane.rows())
    print("\nPX4")
    show(flights_px4.rows())
