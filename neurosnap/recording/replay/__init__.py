"""Deriving a recorded run again: verify, resume, play back."""
