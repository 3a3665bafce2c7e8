"""Tables validated against structs, and the keys that errors name."""

from typing import Annotated

import msgspec

from neurosnap.apps.config.problems import dotted
from neurosnap.apps.config.tables import Config
from neurosnap.apps.config.validate import known_keys, problems
from neurosnap.errors import InvalidValueError


class Pair(msgspec.Struct, frozen=True):
    """Two numbers, the first of which is smaller."""

    name: str
    low: int
    high: int | None = None

    def __post_init__(self) -> None:
        if self.high is not None and not self.low < self.high:
            rule = f"must be more than {self.low}"
            raise InvalidValueError(f"{self.name}: high", rule, self.high)
        if self.low == 7:
            raise InvalidValueError("luck", "must not be pushed", 7)


class Pairs(msgspec.Struct, frozen=True):
    """One pair or more."""

    pairs: Annotated[tuple[Pair, ...], msgspec.Meta(min_length=1)]


def test_every_table_is_judged_as_a_whole_once_its_values_are_right() -> None:
    low = {"name": "a b", "low": 3}
    tables = [low | {"high": 3}, low | {"high": "x"}, low | {"low": 7}, low]
    assert problems({"pairs": 3}, Pairs) == [(("pairs",), "must be a list", 3)]
    assert [(keys, rule) for keys, rule, _ in problems({"pairs": tables}, Pairs)] == [
        (("pairs", 0, "high"), "must be more than 3"),
        (("pairs", 1, "high"), "must be a whole number"),
        (("pairs", 2), "luck: must not be pushed, got 7"),
    ]


# Keys ---------------------------------------------------------------------------------


def test_keys_are_written_as_toml_has_them() -> None:
    assert (
        dotted(("a", "b-c", 0, "d e", 1, 2, "", 'é"'))
        == 'a.b-c[0]."d e"[1][2].""."é\\""'
    )
    assert dotted(()) == ""
    assert ("snapshot", "decay") in known_keys(Config)
