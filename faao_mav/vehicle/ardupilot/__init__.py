"""ArduPilot: ArduCopter and ArduPlane."""
