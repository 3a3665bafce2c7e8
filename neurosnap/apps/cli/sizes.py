"""Sizes in bytes, as one writes them."""

import typer


def in_bytes(size: str | int) -> int:
    """Return a size in bytes, given as that or in KiB, MiB or GiB.

    Raises:
        typer.BadParameter: It is something else.
    """
    units = {"": 1, "KiB": 2**10, "MiB": 2**20, "GiB": 2**30}
    text = str(size)
    number = text.rstrip("KMGiB")
    unit = text[len(number) :]
    if not (number.isascii() and number.isdecimal()) or unit not in units:
        raise typer.BadParameter(f"must be like 256MiB, got {text!r}")
    return int(number) * units[unit]
