"""Arguments that the command line has, too, as `argparse` takes them."""

import argparse

from neurosnap.apps.cli import options
from neurosnap.errors import InvalidValueError


def in_bytes(text: str) -> int:
    """Return a size in bytes; see `neurosnap.apps.cli.options.in_bytes`.

    Raises:
        argparse.ArgumentTypeError: It is none.
    """
    try:
        return options.in_bytes(text)
    except InvalidValueError as error:
        rule = f"{error.rule}, got {text!r}"
        raise argparse.ArgumentTypeError(rule) from error
