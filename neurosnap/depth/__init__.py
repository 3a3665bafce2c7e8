"""Measures how many hops a wave takes, against the longest chain of implications."""
