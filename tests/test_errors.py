"""All errors share one base class and name the object, the rule and the value."""

import functools
import importlib
import inspect
import pkgutil

import pytest

import neurosnap
from neurosnap.errors import InvalidValueError, NeurosnapError, UnknownSensorError


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
