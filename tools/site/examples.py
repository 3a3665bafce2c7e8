"""Lets griffe read `Example:` as `Examples:`, whose code is shown as code."""

import re
from typing import Any

import griffe

_TITLE = re.compile(r"^(\s*)Example:$", re.MULTILINE)


class Examples(griffe.Extension):
    """Renames the section in every docstring before it is parsed."""

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:  # noqa: ANN401
        """Rename it in one docstring."""
        if obj.docstring:
            obj.docstring.value = _TITLE.sub(r"\1Examples:", obj.docstring.value)
