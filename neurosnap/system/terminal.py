"""Output for any terminal: characters it cannot encode are written in ASCII."""

import codecs
import io
import sys

_ERRORS = "neurosnap.ascii"
_ASCII = str.maketrans(
    {"→": "->", "…": "...", "–": "-", "×": "x", "µ": "u", "²": "^2", "—": "-"}
)


def write_ascii_where_needed() -> None:
    r"""Let standard output and error take any letter, whatever they encode in.

    An arrow becomes ``->``; a letter without a likeness its escape, ``\u2603``.
    """
    codecs.register_error(_ERRORS, _in_ascii)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=_ERRORS)


def _in_ascii(error: UnicodeError) -> tuple[str, int]:
    """Return what to write for what cannot be encoded, and where to go on."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end].translate(_ASCII)
    return text.encode("ascii", "backslashreplace").decode("ascii"), error.end
