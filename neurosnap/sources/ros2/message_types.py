"""Decodes messages of ROS 2 (CDR), by the types that come with it or with them.

The types are read by `rosbags`, which makes the code that decodes them: names that
stand in it are letters, digits and underscores, and nothing of a type is evaluated.

The statuses of diagnostics, and pairs of a key and a value, are called by their names
and not by their places: several nodes publish diagnostics, each those it has.
"""

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from mcap.records import Schema

from neurosnap.errors import InvalidValueError
from neurosnap.sources.message_fields import ITEMS
from neurosnap.sources.ros2.keys_and_tokens import NO_HASH
from neurosnap.system.distribution import must_have

LARGEST = 1 << 23
"""Bytes of a message that is decoded, at most."""
STATUS = "diagnostic_msgs/msg/DiagnosticStatus"
ASKED, ANSWERED = (f"type_description_interfaces/msg/{x}" for x in ("Asked", "Answer"))
"""What is sent to the service by which a node says what its types are, and back."""
_KEYED = {STATUS: "name", "diagnostic_msgs/msg/KeyValue": "key"}
_NAMED = 1024  # items that are called by their names, at most
_SIGNS = str.maketrans(dict.fromkeys(".[]()<>=,;", "_"))  # of names of signals
_MOMENTS = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_FILLER = "structure_needs_at_least_one_member"  # of types without fields
_STORES = ("KILTED", "LYRICAL", "JAZZY", "IRON", "HUMBLE")
_BASES = (
    *("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"),
    *("float32", "float64", "float128", "char", "", "bool", "byte", "string"),
)  # from 2 on, as type_description_interfaces/msg/FieldType numbers them
_NESTED, _BOUNDED_STRING = 1, 21
_ARRAY, _BOUNDED, _UNBOUNDED = 1, 2, 3  # times 48
_ASKED_TEXT = """\
string type_name
string type_hash
bool include_type_sources
"""
_ANSWERED_TEXT = """\
bool successful
string failure_reason
type_description_interfaces/TypeDescription type_description
type_description_interfaces/TypeSource[] type_sources
type_description_interfaces/KeyValue[] extra_information
"""
Decoder: TypeAlias = Callable[[bytes], object]


@functools.cache
def stock_types(release: str = _STORES[0]) -> Any:  # noqa: ANN401 - untyped
    """Return the types that come with a release of ROS 2, as a store of `rosbags`.

    Raises:
        ValueError: `rosbags` is not installed.
    """
    return _as_hashed(_store(f"ROS2_{release}"))


def _store(name: str = "EMPTY") -> Any:  # noqa: ANN401 - untyped
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise ValueError(must_have("rosbags", "ros2")) from error
    return get_typestore(Stores[name])


def _as_hashed(store: Any) -> Any:  # noqa: ANN401 - untyped
    """Return a store as ROS 2 hashes it: ``char`` in a ``.msg`` file is a uint8."""

    def numbered(what: Any) -> Any:  # noqa: ANN401 - a field within others
        if what == ("char", 0):
            return "uint8", 0
        return tuple(map(numbered, what)) if isinstance(what, tuple) else what

    for name, (constants, members) in store.fielddefs.items():
        every = [(member, numbered(what)) for member, what in members]
        store.fielddefs[name] = constants, every
    return store


def cdr_decoder(schema: Schema) -> Decoder:
    """Return what decodes the messages of a type that comes with them.

    A message is a dict of its fields, an array of numbers stays one; times are left
    out, which tell when it was and not what.

    Raises:
        ValueError: Its types cannot be read, or `rosbags` is not installed. While
            decoding: the message is none of that type.
    """
    store, text = _store(), schema.data.decode()
    if not text:  # as older bags have it
        store = stock_types()
    elif schema.encoding in ("ros2msg", "ros2idl"):
        _register(store, schema.name, text, schema.encoding)
    else:
        raise ValueError(f"types in {schema.encoding or 'nothing'} are not understood")
    if schema.name not in store.fielddefs:
        raise ValueError(f"types of {schema.name} are not there, and not in ROS 2")
    return _Decoder(store, schema.name)


def _register(
    store: Any,  # noqa: ANN401 - untyped
    name: str,
    text: str,
    encoding: str = "ros2msg",
) -> None:
    from rosbags.typesys import TypesysError, get_types_from_idl, get_types_from_msg

    try:
        if encoding == "ros2idl":
            store.register(get_types_from_idl(text))
        else:
            store.register(get_types_from_msg(text, name))
    except (TypesysError, RecursionError) as error:
        why = type(error).__name__
        raise ValueError(f"types of {name} cannot be read ({why})") from error


class TypesByHash:
    """Finds what decodes a type, which a topic says with a hash of it.

    Args:
        files: ``.msg`` files of further types, each in a folder ``PACKAGE/msg``.

    Raises:
        InvalidValueError: A file cannot be read, or is of no type.
    """

    def __init__(self, files: Sequence[str] = ()) -> None:
        self._files: Any = _store(f"ROS2_{_STORES[0]}") if files else None
        for file in map(Path, files):
            *_, package, folder, _ = ("", "", *file.absolute().parts)
            if folder != "msg" or file.suffix != ".msg":
                rule = "must be PACKAGE/msg/TYPE.msg"
                raise InvalidValueError("msg_files", rule, str(file))
            try:
                _register(self._files, f"{package}/msg/{file.stem}", file.read_text())
            except (OSError, ValueError) as error:
                rule = f"must be a file of a type ({error})"
                raise InvalidValueError("msg_files", rule, str(file)) from error
        if files:
            _as_hashed(self._files)

    def find(self, name: str, hashed: str) -> Decoder | None:
        """Return what decodes a type that comes with ROS 2, or of the files."""
        stores = [stock_types(release) for release in _STORES]
        if hashed == NO_HASH:  # Humble's are known by their names alone
            stores = stores[-1:]
        for store in (*stores, *((self._files,) if self._files else ())):
            if name in store.types and hashed in (NO_HASH, _hash(store, name)):
                return _Decoder(store, name)
        return None

    def described(self, name: str, hashed: str, answer: bytes) -> Decoder:
        """Return what decodes a type, by the answer of a node to `question`.

        Raises:
            ValueError: It describes no such type.
        """
        said = _service().deserialize_cdr(answer, ANSWERED)
        if not said.successful:
            raise ValueError(f"its node says of it: {said.failure_reason[:200]}")
        about, store = said.type_description, _store()
        every = (about.type_description, *about.referenced_type_descriptions)
        for one in every[:_NAMED]:
            _register(store, one.type_name, "".join(map(_line, one.fields)))
        if name not in store.types or _hash(store, name) != hashed:
            raise ValueError("its node describes another type")
        return _Decoder(store, name)


def question(name: str, hashed: str) -> bytes:
    """Return the question for a type to a node's service `get_type_description`."""
    store = _service()
    asked = store.types[ASKED](name, hashed, False)
    return bytes(store.serialize_cdr(asked, ASKED))


@functools.cache
def _service() -> Any:  # noqa: ANN401 - untyped
    store = _store(f"ROS2_{_STORES[0]}")
    _register(store, ASKED, _ASKED_TEXT)
    _register(store, ANSWERED, _ANSWERED_TEXT)
    return store


def _line(field: Any) -> str:  # noqa: ANN401 - untyped
    """Return a described field as a line of a ``.msg`` file.

    Raises:
        ValueError: It is of a type that is not decoded, such as wide strings.
    """
    what = field.type
    many, base = divmod(what.type_id, 48)
    if base == _NESTED:
        name = what.nested_type_name
    elif base == _BOUNDED_STRING:
        name = f"string<={what.string_capacity}"
    elif not (0 <= base - 2 < len(_BASES)) or not (name := _BASES[base - 2]):
        raise ValueError(f"its field {field.name[:80]} is of a type that is not read")
    size = {_ARRAY: f"[{what.capacity}]", _BOUNDED: f"[<={what.capacity}]"}
    size |= {0: "", _UNBOUNDED: "[]"}
    return f"{name}{size[many]} {field.name}\n"


def _hash(store: Any, name: str) -> str | None:  # noqa: ANN401 - untyped
    """Return the hash of a type; None if a type that it is made of is missing."""
    try:
        return str(store.hash_rihs01(name))
    except (KeyError, AssertionError):
        return None


class _Decoder:
    """Decodes the messages of one type."""

    def __init__(self, store: Any, name: str) -> None:  # noqa: ANN401 - untyped
        self._store, self._name = store, name
        self._decode: dict[bytes, Any] = {}  # by the order of bytes
        self._class: Any = None
        # The fields of each type that are read, and whether they are octets.
        self._names: dict[str, dict[str, bool]] = {}

    def __call__(self, data: bytes) -> object:
        try:
            if not self._decode:  # here: to make it may fail of the type
                one = self._store.get_msgdef(self._name)
                self._class = one.cls
                self._decode[b"\0\0"] = one.deserialize_cdr_be
                self._decode[b"\0\1"] = one.deserialize_cdr_le
            # Not `deserialize_cdr`, which refuses what ROS 2 does not: bytes behind the
            # message, as its own `serialize_message` leaves behind empty sequences.
            decode = self._decode[data[:2]]
            return self._plain(decode(data[4:], 0, self._class, self._store)[0])
        except Exception as error:  # code that was made of a stranger's types
            rule = f"must be a message of {self._name} ({type(error).__name__})"
            raise ValueError(rule) from error

    def _plain(self, value: Any) -> object:  # noqa: ANN401 - any field
        """Return a field as JSON would have it."""
        if isinstance(value, (float, int, str, np.ndarray)) or value is None:
            return value
        if (kind := getattr(value, "__msgtype__", None)) is None:
            if value and (key := _KEYED.get(getattr(value[0], "__msgtype__", ""))):
                return dict(self._keyed(value[:_NAMED], key))
            return [self._plain(item) for item in value[:ITEMS]]
        if (names := self._names.get(kind)) is None:
            _, members = self._store.fielddefs[kind]
            names = {
                name: what[0] == "byte" or what[0][1:] == (("byte", 0),)
                for name, (_, what) in members
                if what not in _MOMENTS and name != _FILLER
            }
            self._names[kind] = names
        return {
            name: _unsigned(said) if octet else self._plain(said)
            for name, octet in names.items()
            for said in (getattr(value, name),)
        }

    def _keyed(self, items: Sequence[Any], key: str) -> Iterator[tuple[str, object]]:
        for item in items:
            fields = self._plain(item)
            if isinstance(fields, Mapping):  # of a stranger's type, with that name
                name = str(fields.get(key, "")).translate(_SIGNS)
                rest = {k: value for k, value in fields.items() if k != key}
                yield name, rest["value"] if list(rest) == ["value"] else rest


def _unsigned(octets: Any) -> object:  # noqa: ANN401 - one, or an array
    """Return what ROS 2 calls bytes, which `rosbags` reads with a sign."""
    return octets.view(np.uint8) if isinstance(octets, np.ndarray) else octets % 256
