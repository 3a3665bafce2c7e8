"""Writes recordings, and recovers their files after a crash or damage."""
