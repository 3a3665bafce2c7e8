"""How many examples a property is tried with, by profile.

``quick`` is for `make quick`, ``test`` for `make test`, ``wide`` for `make test-all`.
In CI each draws the same examples every time.
"""

import os

from hypothesis import settings

PROFILES = {"quick": 10, "test": 25, "wide": 100}
"""The examples that each profile draws of every property."""


def register() -> None:
    """Register the profiles, and load the one of `make test`."""
    for name, most in PROFILES.items():
        fixed = bool(os.environ.get("CI"))
        settings.register_profile(
            name, deadline=None, max_examples=most, derandomize=fixed
        )
    settings.load_profile("test")


def examples(wide: int) -> settings:
    """Return the settings of a property that draws more or fewer than others.

    The profile ``wide`` draws so many; the others as much fewer as usual. Plain
    settings in a module would overrule the profile.
    """
    share = settings().max_examples / PROFILES["wide"]
    return settings(max_examples=max(1, round(wide * share)))


def cases(wide: int) -> int:
    """Return how many seeds a test goes through: so many in the profile ``wide``."""
    return examples(wide).max_examples
