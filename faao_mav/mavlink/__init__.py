"""The wire: missions to and from vehicles, and a mock autopilot."""
