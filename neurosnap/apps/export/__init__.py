"""Tables, pages and pictures for other programs.

A recording holds what was on the wire and nothing else, so that it can be verified;
what is derived from it goes into a file of its own.
"""
