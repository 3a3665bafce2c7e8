"""Every error raised on purpose is under one root and names thing, rule and value."""

import functools
import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable
from pathlib import Path

import pytest

import neurosnap
from neurosnap.agent.body import Body
from neurosnap.errors import (
    AnswerLostError,
    FabricError,
    InboxOverflowError,
    InvalidValueError,
    MessageError,
    NeurosnapError,
    RecordingError,
    ShapeError,
    SwarmError,
    UnknownSensorError,
)
from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.write.writer import Writer
from neurosnap.sensorium import Sensorium, pack, unpack
from neurosnap.sources.open import open_source


def modules() -> list[str]:
    """Return every module of the package; importing `__main__` runs nothing."""
    found = pkgutil.walk_packages(neurosnap.__path__, "neurosnap.")
    return ["neurosnap", *(module.name for module in found)]


@functools.cache
def public_errors() -> dict[str, type[BaseException]]:
    """Return the exception classes that modules of the package define."""
    found: dict[str, type[BaseException]] = {}
    for name in modules():
        for kind in vars(importlib.import_module(name)).values():
            if (
                inspect.isclass(kind)
                and issubclass(kind, BaseException)
                and kind.__module__ == name
                and not kind.__name__.startswith("_")
            ):
                found[f"{name}.{kind.__qualname__}"] = kind
    return found


def test_every_public_error_is_under_the_root() -> None:
    found = public_errors()
    assert found["neurosnap.errors.UnknownSensorError"] is UnknownSensorError
    for name, kind in found.items():
        assert issubclass(kind, NeurosnapError), name
        assert kind.__name__.endswith("Error"), name
        assert kind.__doc__, name


def test_an_error_is_the_builtin_or_the_family_that_it_refines() -> None:
    for kind in (InvalidValueError, ShapeError, UnknownSensorError, MessageError):
        assert issubclass(kind, ValueError)
    assert issubclass(UnknownSensorError, KeyError)
    assert issubclass(InboxOverflowError, FabricError)
    assert issubclass(AnswerLostError, SwarmError)
    assert issubclass(ShapeError, InvalidValueError)
    assert not issubclass(RecordingError, ValueError)


def test_an_invalid_value_names_the_thing_the_rule_and_the_value() -> None:
    error = InvalidValueError("threshold", "must be in (0, 0.25]", 0.7)
    assert str(error) == "threshold: must be in (0, 0.25], got 0.7"
    said = ("threshold", "must be in (0, 0.25]", 0.7)
    assert (error.name, error.rule, error.value) == said
    # Its text, and not a repr of it, as other errors of keys have it.
    unknown = UnknownSensorError("sensor", "must be one of 3", "door")
    assert str(unknown) == "sensor: must be one of 3, got 'door'"


@pytest.mark.parametrize("length", [198, 199, 100_000])
def test_a_long_value_is_cut(length: int) -> None:
    shown = str(InvalidValueError("bits", "must be short", "x" * length))
    _, _, value = shown.partition(", got ")
    assert len(value) <= 200
    assert value.endswith("..." if length > 198 else "x'")


def test_an_overflow_names_the_owner_and_the_room_it_had() -> None:
    error = InboxOverflowError("cell/3", 1024)
    assert str(error).startswith("cell/3: inbox must be read ")
    assert "1024" in str(error)
    assert (error.owner, error.capacity) == ("cell/3", 1024)


RAISED: dict[str, Callable[[Path], object]] = {
    "threshold": lambda _: EmpiricalSnapshot(3, threshold=0.7),
    "threshold NaN": lambda _: EmpiricalSnapshot(3, threshold=float("nan")),
    "decay": lambda _: DiscountedSnapshot(3, decay=1.0),
    "sensors": lambda _: EmpiricalSnapshot(-1),
    "names": lambda _: Sensorium(["a", "a"]),
    "a name": lambda _: Sensorium(["a*"]),
    "literal": lambda _: Sensorium(["a"]).name(2),
    "no such name": lambda _: Sensorium(["a"]).literal("b"),
    "bits": lambda _: Sensorium(["a", "b"]).observation([1]),
    "a bit": lambda _: Sensorium(["a", "b"]).observation([1, 2]),
    "packing": lambda _: pack([[True]]),
    "unpacking": lambda _: unpack(b"", 3),
    "edges": lambda _: PocGraph.from_implications(2, [(0, 9)]),
    "source": lambda _: open_source("neurosnap/Nowhere-v0", 0),
    "seed": lambda _: open_source("neurosnap/Path-v0", -1),
    "file": lambda folder: open_source(str(folder / "none.csv"), 0),
    "options": lambda _: RunOptions(
        source="x", body=Body(own=("a",)), decay=0.5
    ).new_snapshot(),
    "chunk": lambda folder: Writer(folder / "log", chunk=0),
}


@pytest.mark.parametrize("what", RAISED)
def test_a_message_reads_name_rule_value(what: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError) as caught:
        RAISED[what](tmp_path)
    error = caught.value
    assert str(error) == f"{error.name}: {error.rule}, got {error.value!r}"
    assert re.match(r"[\w./:\- ]+: must .*, got .+$", str(error), re.DOTALL), str(error)
