"""Propagation depth against the height of the order."""
