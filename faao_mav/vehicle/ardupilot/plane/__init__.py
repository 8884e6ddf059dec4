"""How ArduPlane flies a mission."""
