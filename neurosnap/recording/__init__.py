"""Recordings: written and read as MCAP files, and verified by replay."""
