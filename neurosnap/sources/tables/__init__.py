"""Readings that are there as a whole: files of rows, logs, databases."""
