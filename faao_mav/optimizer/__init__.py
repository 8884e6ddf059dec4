"""The optimiser: trajectory and precoders together."""
