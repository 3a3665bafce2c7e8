"""Sensors that are grown: which, when, and how a snapshot takes them in."""
