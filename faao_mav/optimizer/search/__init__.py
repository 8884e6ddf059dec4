"""Flights to start from, and the bound that no flight exceeds."""
