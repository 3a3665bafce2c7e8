"""Decodes messages of ROS 2 (CDR), by the types that a recording brings with it.

The types are read by `rosbags`, which makes the code that decodes them: names that
stand in it are letters, digits and underscores, and nothing of a type is evaluated.
"""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from mcap.records import Schema

from neurosnap.sources.message_fields import ITEMS
from neurosnap.system.distribution import must_have

_MOMENTS = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
Decoder = Callable[[bytes], object]


@functools.cache
def stock_types() -> Any:  # noqa: ANN401 - untyped
    """Return the types that come with ROS 2 (Kilted), as a store of `rosbags`.

    Raises:
        ValueError: `rosbags` is not installed.
    """
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise ValueError(must_have("rosbags", "ros2")) from error
    return get_typestore(Stores.ROS2_KILTED)


def cdr_decoder(schema: Schema) -> Decoder:
    """Return what decodes the messages of a type.

    A message is a dict of its fields, an array of numbers stays one; times are left
    out, which tell when it was and not what.

    Raises:
        ValueError: Its types cannot be read, or `rosbags` is not installed. While
            decoding: the message is none of that type.
    """
    try:
        from rosbags.typesys import (
            Stores,
            TypesysError,
            get_types_from_idl,
            get_types_from_msg,
            get_typestore,
        )
    except ImportError as error:
        raise ValueError(must_have("rosbags", "ros2")) from error
    store, text = get_typestore(Stores.EMPTY), schema.data.decode()
    try:
        if not text:  # as older bags have it
            store = stock_types()
        elif schema.encoding == "ros2msg":
            store.register(get_types_from_msg(text, schema.name))
        elif schema.encoding == "ros2idl":
            store.register(get_types_from_idl(text))
        else:
            raise ValueError(
                f"types in {schema.encoding or 'nothing'} are not understood"
            )
    except (TypesysError, RecursionError) as error:
        why = type(error).__name__
        raise ValueError(f"types of {schema.name} cannot be read ({why})") from error
    if schema.name not in store.fielddefs:
        raise ValueError(f"types of {schema.name} are not there, and not in ROS 2")
    return _Decoder(store, schema.name)


class _Decoder:
    """Decodes the messages of one type."""

    def __init__(self, store: Any, name: str) -> None:  # noqa: ANN401 - untyped
        self._store, self._name = store, name
        self._names: dict[str, list[str]] = {}  # the fields of each type that are read

    def __call__(self, data: bytes) -> object:
        try:
            return self._plain(self._store.deserialize_cdr(data, self._name))
        except Exception as error:  # code that was made of a stranger's types
            rule = f"must be a message of {self._name} ({type(error).__name__})"
            raise ValueError(rule) from error

    def _plain(self, value: Any) -> object:  # noqa: ANN401 - any field
        """Return a field as JSON would have it."""
        if isinstance(value, (float, int, str, np.ndarray)) or value is None:
            return value
        if (kind := getattr(value, "__msgtype__", None)) is None:
            return [self._plain(item) for item in value[:ITEMS]]
        if (names := self._names.get(kind)) is None:
            _, members = self._store.fielddefs[kind]
            names = [name for name, (_, what) in members if what not in _MOMENTS]
            self._names[kind] = names
        return {name: self._plain(getattr(value, name)) for name in names}
