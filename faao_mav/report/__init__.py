"""Figures, and the page that tells of a flight without a network."""
