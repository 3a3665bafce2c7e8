"""Snapshots, poc graphs and their order: pure, synchronous, arrays in, arrays out.

[GK] in docstrings is D. P. Guralnik and D. E. Koditschek, *Universal Memory
Architectures for Autonomous Machines*; definitions and propositions are quoted by
their labels there, which ``docs/paper.md`` lists. Literals: sensor ``s`` is literal
``2s``, its complement ``2s + 1``; the complement of literal ``a`` is ``a ^ 1``.
"""
