"""Splits a byte stream into lines with bounded memory."""

from collections.abc import Iterator


class Lines:
    """Numbers the lines of a stream that arrives in pieces of any size.

    Args:
        limit: Bytes of a line at most; a longer one is not kept.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._number = 0
        self._begun: bytes | None = b""
        """What there is of the next line; None: it is too long already."""

    def feed(self, piece: bytes) -> Iterator[tuple[int, bytes | None]]:
        """Yield the number and the text of every line that `piece` ends.

        The text comes without its line feed; None: the line was too long.
        """
        *ended, rest = piece.split(b"\n")
        for part in ended:
            yield self._end(part)
        self._add(rest)

    def finish(self) -> Iterator[tuple[int, bytes | None]]:
        """Yield what follows the last line feed, if anything does."""
        if self._begun != b"":
            yield self._end(b"")

    def _add(self, part: bytes) -> None:
        if self._begun is not None:
            whole = len(self._begun) + len(part) <= self._limit
            self._begun = self._begun + part if whole else None

    def _end(self, part: bytes) -> tuple[int, bytes | None]:
        self._add(part)
        line, self._begun = self._begun, b""
        self._number += 1
        return self._number, line
