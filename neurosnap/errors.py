"""All errors that this package raises on purpose, with a common base class.

Messages read ``name: rule, got value``, so that a user knows the thing, the rule and
what was given. Each error also inherits the built-in it refines, so callers
may catch either.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path


class NeurosnapError(Exception):
    """The root of all errors raised on purpose by neurosnap."""


class InvalidValueError(NeurosnapError, ValueError):
    """An argument breaks its rule.

    Args:
        name: What was given, in the caller's words (``"threshold"``).
        rule: What it must be (``"must be in (0, 0.25]"``).
        value: What it was; shown with `repr`, cut when long.
    """

    def __init__(self, name: str, rule: str, value: object) -> None:
        shown = repr(value)
        if len(shown) > 200:
            shown = f"{shown[:197]}..."
        super().__init__(f"{name}: {rule}, got {shown}")
        self.name = name
        self.rule = rule
        self.value = value


def similar(given: object, known: Iterable[str]) -> str:
    """Return a hint at the most similar name, for the end of a rule; or nothing.

    Examples:
        >>> similar("planer", ["walker", "planner"]), similar("x", ["walker"])
        (' (did you mean planner?)', '')
    """
    import difflib  # 5 ms

    found = difflib.get_close_matches(str(given), known)
    return f" (did you mean {either(found)}?)" if found else ""


def either(words: Iterable[str]) -> str:
    """Return a choice in words.

    Examples:
        >>> either(["a", "b", "c"])
        'a, b or c'
    """
    *most, last = words
    return f"{', '.join(most)} or {last}" if most else last


class ShapeError(InvalidValueError):
    """An array has the wrong shape or the wrong length."""


class UnknownSensorError(InvalidValueError, KeyError):
    """A name or a literal is not in the sensorium."""

    # KeyError would show the repr of the message; the plain text is meant.
    __str__ = Exception.__str__


class MissingExtraError(NeurosnapError):
    """A package is needed that comes with an extra and is not installed."""


class MessageError(NeurosnapError, ValueError):
    """A payload is no message of this protocol, or came under the wrong key."""


class FabricError(NeurosnapError):
    """A fabric could not do what it promises."""


class InboxOverflowError(FabricError):
    """An owner's inbox received more messages than its capacity before it was read."""

    def __init__(self, owner: str, capacity: int) -> None:
        super().__init__(
            f"{owner}: inbox must be read before it holds more than {capacity} messages"
        )
        self.owner = owner
        self.capacity = capacity


class SwarmError(NeurosnapError):
    """A run could not be carried out; the text names the part and the cause."""


class NothingBegunError(NeurosnapError):
    """A run was stopped before any part of it had begun."""


class PartDiedError(SwarmError):
    """A part was killed, vanished or hangs; it might live if started anew."""


class AnswerLostError(PartDiedError):
    """Parts did not answer in time, however often asked.

    A wave did not settle, cells did not answer from their histories, or workers that
    share the learning did not learn.
    """


class RecordingError(NeurosnapError):
    """A file cannot be read or written as a recording, or neurosnap did not make it."""


class NoRecordingError(RecordingError):
    """The path given for a recording is not a file that can be opened."""


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Add the file's name to an error of the operating system.

    A full disk shows when a file is written to, and the error does not name it then; a
    draft's name would mean nothing to whoever asked for the file.

    Raises:
        OSError: As it came, with `path` as its file name.
    """
    try:
        yield
    except OSError as error:
        error.filename = str(path)
        raise


def within(place: str, error: InvalidValueError) -> InvalidValueError:
    """Return `error` with the place it happened at before its name."""
    return type(error)(f"{place}: {error.name}", error.rule, error.value)
