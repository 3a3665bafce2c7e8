"""Learns which sensor readings imply which, by counting pairs of sensors."""
