"""Arguments that the command line has, too, as `argparse` takes them."""

import argparse

import typer

from neurosnap.apps.cli import options


def in_bytes(text: str) -> int:
    """Return a size in bytes; see `neurosnap.apps.cli.options.in_bytes`.

    Raises:
        argparse.ArgumentTypeError: It is none.
    """
    try:
        return options.in_bytes(text)
    except typer.BadParameter as error:
        raise argparse.ArgumentTypeError(error.message) from error
