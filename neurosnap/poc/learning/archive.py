"""Saves named arrays as the same bytes each time; loads them without unpickling.

Members are stored, not deflated, in the order given and with one fixed date, so that
neither the clock nor the zlib at hand shows in the file. Reading checks every
checksum before a byte is parsed and never unpickles.
"""

import io
import zipfile
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import DTypeLike, NDArray

Arrays: TypeAlias = dict[str, NDArray[Any]]
_DATE = (1980, 1, 1, 0, 0, 0)
_UNIX = 3


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
