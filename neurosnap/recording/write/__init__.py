"""Writing a recording, and what becomes of its files after a death or damage."""
