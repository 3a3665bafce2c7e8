"""Asks several parts until all answer, or reports which did not.

A wave, a question to the histories of cells, and what workers learn are asked, gathered
and asked again in the same way. They differ in how an answer is checked, and in what
shows which parts are silent.
"""

from collections.abc import Iterable, Sequence
from typing import Generic, TypeVar

from neurosnap.errors import AnswerLostError

T = TypeVar("T")
_NAMED = 10  # parts, in an error


class Round(Generic[T]):
    """One request to several parts: how often it was asked, and the answers so far.

    Args:
        what: Names it in an error, as in ``recall 3 (tick 4)``.
        repeats: How often it may be asked again.
        parts: The names of the parts that are asked.

    Attributes:
        answers: By part; None as long as it is silent.
        tries: How often it was asked.
    """

    def __init__(self, what: str, repeats: int, parts: Iterable[str] = ()) -> None:
        self.what = what
        self.answers: dict[str, T | None] = dict.fromkeys(parts)
        self.tries = 1
        self._repeats = repeats

    @property
    def silent(self) -> list[str]:
        """The parts that have not answered."""
        return [who for who, answer in self.answers.items() if answer is None]

    def ask_again(
        self,
        names: Sequence[str],
        lack: str = "silent",
        *,
        rule: str = "be answered",
        spare: int = 0,
    ) -> None:
        """Count that it is asked once more.

        Args:
            names: The parts because of which it is.
            lack: What they lack.
            rule: What should have come about.
            spare: Tries that do not count.

        Raises:
            AnswerLostError: It was asked as often as allowed; the error names them.
        """
        if self.tries > self._repeats + spare:
            named = ", ".join(names[:_NAMED]) or "none"
            more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
            raise AnswerLostError(
                f"{self.what}: must {rule} within its deadline, got {self.tries}"
                f" tries; {lack}: {named}{more}"
            )
        self.tries += 1
