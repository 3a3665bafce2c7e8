"""JSON answers, and numbers parsed from query strings."""

import msgspec
from starlette.datastructures import QueryParams
from starlette.responses import Response

from neurosnap.apps.viewer.api import Wrong
from neurosnap.errors import InvalidValueError

_DIGITS = 10
"""The most digits a number may have: what has more is none of ours."""

_encoder = msgspec.json.Encoder()


def answer(found: msgspec.Struct, status: int = 200) -> Response:
    """Return a struct as JSON."""
    return Response(_encoder.encode(found), status, media_type="application/json")


def refusal(status: int, error: str) -> Response:
    """Return what is wrong."""
    return answer(Wrong(error), status)


def whole(query: QueryParams, name: str, default: int | None = None) -> int:
    """Return a whole number from 0 up that was asked with.

    Args:
        query: What stands behind the question mark.
        name: What it is called there.
        default: What it is where it is not there; None: it has to be.

    Raises:
        InvalidValueError: It is not there, or something else.
    """
    text = query.get(name)
    if text is None and default is not None:
        return default
    if text is None or not text.isascii() or not text.isdecimal():
        raise InvalidValueError(name, "must be a whole number from 0 up", text)
    if len(text) > _DIGITS:
        rule = f"must have at most {_DIGITS} digits"
        raise InvalidValueError(name, rule, f"{len(text)} of them")
    return int(text)
