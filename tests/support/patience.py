"""How long a test waits for what must come: a net for hangs, no measure of speed."""

PATIENCE = 240.0
"""Seconds; many times what the slowest wait takes on one busy core."""
