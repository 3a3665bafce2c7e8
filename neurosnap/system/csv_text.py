"""Escapes CSV text that a spreadsheet would run as a formula.

Names come from files and programs of other people. A spreadsheet that opens a CSV file
runs what begins with ``=``, ``+``, ``-`` or ``@``, however it is quoted. An apostrophe
in front stops that. It is taken off again when the file is read here, and text that
begins with apostrophes and such a sign gets one more, so no name is changed on its way.
"""

import re

# Also as wide letters, which some spreadsheets take for the same; and behind what they
# skip at the beginning.
_FORMULA = re.compile(r"'*[\t\r\n]*[=+\-@＝＋－＠]")


def as_text(text: str) -> str:
    """Return `text` with an apostrophe before it if a spreadsheet would run it.

    Example:
        >>> as_text("=1+1"), as_text("door"), as_text("-")
        ("'=1+1", 'door', '-')
    """
    # A lone sign is no formula; as a decision it says that nothing was done.
    return f"'{text}" if len(text) > 1 and _FORMULA.match(text) else text


def as_written(text: str) -> str:
    """Return what `as_text` was given.

    Example:
        >>> as_written("'=1+1"), as_written("'tis")
        ('=1+1', "'tis")
    """
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text
