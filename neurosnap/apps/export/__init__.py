"""A recording in the formats of other programs: tables.

A recording holds what was on the wire and nothing else, so that it can be verified;
what is derived from it goes into a file of its own.
"""
