"""Timeouts of the tests, which only catch hangs."""

PATIENCE = 240.0
"""Seconds; many times what the slowest wait takes on one busy core."""
