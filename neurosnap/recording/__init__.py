"""Recordings: MCAP out, MCAP in, and the proof that a run was what it says."""
