"""The text with which a check refuses a message."""

from collections.abc import Callable

from neurosnap.errors import MessageError


def refusal(check: Callable[..., None], *arguments: object) -> str | None:
    """Return the text of the `MessageError` of a check, or None if it passes."""
    try:
        check(*arguments)
    except MessageError as error:
        return str(error)
    return None
