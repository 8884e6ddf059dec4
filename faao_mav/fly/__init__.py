"""Flights on the wire: watching them, and reading their logs."""
