"""A recording to look at: one page on this machine, and what it asks for."""
