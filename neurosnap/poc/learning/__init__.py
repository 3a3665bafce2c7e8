"""Snapshots: weights learned from observations, and the poc graph they derive."""
