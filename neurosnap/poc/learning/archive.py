"""Saves named arrays as the same bytes each time; loads them without unpickling.

Members are stored, not deflated, in the order given and with one fixed date, so that
neither the clock nor the zlib at hand shows in the file. Reading checks every
checksum before a byte is parsed and never unpickles.
"""

import abc
import inspect
import io
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar, Self, TypeAlias

import numpy as np
from numpy.typing import DTypeLike, NDArray

from neurosnap.errors import InvalidValueError

Arrays: TypeAlias = dict[str, NDArray[Any]]

_SCHEMA = 1

_DATE = (1980, 1, 1, 0, 0, 0)
_UNIX = 3


class Archived(abc.ABC):
    """What can be written to one file and read back bit for bit.

    Each concrete kind is known by the name of its class.
    """

    _kinds: ClassVar[dict[str, type["Archived"]]] = {}

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls._kinds[cls.__name__] = cls

    def to_bytes(self) -> bytes:
        """Return its whole state as the bytes of an ``.npz`` file.

        Equal contents give equal bytes.
        """
        return self.packed(self.arrays())

    @classmethod
    def packed(cls, arrays: Arrays) -> bytes:
        """Return arrays of this kind as the bytes of an ``.npz`` file."""
        head = {
            "schema": np.array(_SCHEMA, np.int64),
            "kind": np.array(cls.__name__),
        }
        return pack_arrays(head | arrays)

    @classmethod
    def from_bytes(cls, data: bytes) -> Self:
        """Return what `to_bytes` made `data` of, bit for bit.

        Raises:
            InvalidValueError: `data` is damaged, foreign, or of another kind.
        """
        return cls.read("data", data)

    @abc.abstractmethod
    def arrays(self) -> Arrays:
        """Return its whole state as arrays, by name."""

    @classmethod
    @abc.abstractmethod
    def from_arrays(cls, arrays: Arrays) -> Self:
        """Return what has these arrays.

        Raises:
            ValueError: They make no sense.
        """

    @classmethod
    def read(cls, name: str, data: bytes) -> Self:
        """Return the archive in bytes that errors call `name`; see `from_bytes`."""
        with cls.reading(name):
            arrays = unpack_arrays(data)
            return cls.kind_of(arrays).from_arrays(arrays)

    @classmethod
    @contextmanager
    def reading(cls, name: str) -> Iterator[None]:
        """Say of what cannot be read that it is none of this kind."""
        try:
            yield
        except ValueError as error:
            rule = f"must be a {cls.__name__} written by this package"
            raise InvalidValueError(name, rule, str(error)) from error

    @classmethod
    def kind_of(cls, arrays: Arrays) -> type[Self]:
        """Return the class that wrote the arrays.

        Raises:
            ValueError: It is none of this kind.
        """
        if entry(arrays, "schema", (), np.int64).item() != _SCHEMA:
            raise ValueError(f"schema: must be {_SCHEMA}")
        kind = cls._kinds.get(str(entry(arrays, "kind", (), np.str_).item()))
        if kind is None or not issubclass(kind, cls) or inspect.isabstract(kind):
            raise ValueError(f"kind: must be {cls.__name__}")
        return kind


def entry(
    arrays: Arrays, key: str, shape: tuple[int, ...], dtype: DTypeLike
) -> NDArray[Any]:
    """Return an array that must be there and have this shape and type.

    Text may have any width.

    Raises:
        ValueError: It is not there, or not like that.
    """
    if key not in arrays:
        raise ValueError(f"{key}: must be there")
    array = arrays[key]
    kind = np.dtype(dtype)
    same = array.dtype.kind == "U" if kind.kind == "U" else array.dtype == kind
    if array.shape != shape or not same:
        raise ValueError(f"{key}: must be {kind} {shape}")
    return array


def rows_in(arrays: Arrays, key: str) -> int:
    """Return how long an array's first axis is; 0 if it has none, or is not there."""
    array = arrays.get(key)
    return 0 if array is None or not array.ndim else len(array)


def pack_arrays(arrays: Arrays) -> bytes:
    """Return the arrays as the bytes of an ``.npz`` file."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, array in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy", _DATE)
            member.create_system = _UNIX
            text = io.BytesIO()
            np.lib.format.write_array(text, array, version=(1, 0), allow_pickle=False)
            archive.writestr(member, text.getvalue())
    return buffer.getvalue()


def unpack_arrays(data: bytes) -> Arrays:
    """Return the arrays of an ``.npz`` file's bytes.

    Raises:
        ValueError: It is no such file, is cut short or is damaged.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return {
                member.filename.removesuffix(".npy"): _member(archive, member)
                for member in archive.infolist()
            }
    except (
        zipfile.BadZipFile,
        EOFError,
        MemoryError,
        NotImplementedError,
        OSError,
        OverflowError,
        RuntimeError,
        SyntaxError,
        TypeError,
    ) as error:
        raise ValueError(str(error)) from error


def _member(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    """Return one array of an archive."""
    if member.compress_type != zipfile.ZIP_STORED:
        raise ValueError(f"{member.filename} is compressed")
    # Reading the member whole verifies its checksum before the header is believed.
    array: NDArray[Any] = np.lib.format.read_array(
        io.BytesIO(archive.read(member)), allow_pickle=False
    )
    return array
