"""How many examples a property is tried with: all of them, or few for `make quick`."""

from hypothesis import settings

QUICK = 15
"""What the profile `quick` draws, of every property."""


def examples(most: int) -> settings:
    """Return the settings of a property that draws fewer or more than is usual.

    Plain settings in a module would overrule the profile.
    """
    usual = settings().max_examples
    return settings(max_examples=min(most, usual) if usual == QUICK else most)
