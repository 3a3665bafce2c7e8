"""A recording in the formats of other programs: tables, graphs, drawable messages.

A recording holds what was on the wire and nothing else, so that it can be verified;
whatever is derived from it for somebody's convenience goes into a file of its own.
"""
