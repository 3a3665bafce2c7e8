"""Splits a wave's credit into powers of two that add up exactly."""


def split_evenly(credit: int, parts: int) -> list[int]:
    """Split the share ``2^-credit`` into `parts` shares that add up to it exactly.

    They are the leaf depths of a complete binary tree, so they differ by at most one
    and nothing is left over.

    Args:
        credit: The exponent to split.
        parts: How many shares, at least 1.

    Returns:
        The exponents of the shares, larger shares first.
    """
    depth = (parts - 1).bit_length()
    larger = (1 << depth) - parts
    smaller = parts - larger
    return [credit + depth - 1] * larger + [credit + depth] * smaller
