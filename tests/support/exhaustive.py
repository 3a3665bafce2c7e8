"""Marks the rows of a test's table that only `make test-all` runs."""

from collections.abc import Iterable
from typing import Any

import pytest


def rows(first: Iterable[object], more: Iterable[object]) -> list[Any]:
    """Return the rows of a test.

    Args:
        first: What `make test` runs.
        more: What only `make test-all` adds, because it costs much and finds little
            that the first do not. A tuple has a value for each parameter.
    """
    exhaustive = pytest.mark.exhaustive
    return [
        *first,
        *(
            pytest.param(*(row if isinstance(row, tuple) else [row]), marks=exhaustive)
            for row in more
        ),
    ]
