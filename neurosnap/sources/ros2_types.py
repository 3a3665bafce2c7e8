"""Decodes messages of ROS 2 (CDR), by the types that a recording brings with it.

The types are read by `rosbags`, which makes the code that decodes them: names that
stand in it are letters, digits and underscores, and nothing of a type is evaluated.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from mcap.records import Schema

from neurosnap.system.distribution import must_have

_ITEMS = 64
_MOMENTS = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
Decoder = Callable[[bytes], object]


def cdr_decoder(schema: Schema) -> Decoder:
    """Return what decodes the messages of a type.

    A message is a dict of its fields, and a list of its first 64 items; times are left
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
        if schema.encoding == "ros2msg":
            store.register(get_types_from_msg(text, schema.name))
        elif schema.encoding == "ros2idl":
            store.register(get_types_from_idl(text))
        else:
            raise ValueError(f"types in {schema.encoding or 'nothing'}")
    except (TypesysError, RecursionError) as error:
        raise ValueError(f"types of {schema.name}: {type(error).__name__}") from error
    return partial(_decoded, store, schema.name)


def _decoded(store: Any, name: str, data: bytes) -> object:  # noqa: ANN401 - untyped
    try:
        return _plain(store, store.deserialize_cdr(data, name))
    except Exception as error:  # code that was made of a stranger's types
        rule = f"must be a message of {name} ({type(error).__name__})"
        raise ValueError(rule) from error


def _plain(store: Any, value: Any) -> object:  # noqa: ANN401 - any field
    """Return a field as JSON would have it."""
    if isinstance(value, (str, int, float, bool)) or value is None:
        return value
    if isinstance(value, np.ndarray):
        return value[:_ITEMS].tolist()
    if (kind := getattr(value, "__msgtype__", None)) is None:
        return [_plain(store, item) for item in value[:_ITEMS]]
    _, members = store.fielddefs[kind]
    fields = ((name, getattr(value, name)) for name, _ in members)
    return {
        name: _plain(store, field)
        for name, field in fields
        if getattr(field, "__msgtype__", "") not in _MOMENTS
    }
