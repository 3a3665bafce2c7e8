"""Faults put into recordings of lived-in homes: who finds them, and who cries wolf."""
