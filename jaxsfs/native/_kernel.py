"""Functions that Numba compiles for the CPU, called by XLA within a jitted program.

XLA hands a foreign function the address of a call frame (`xla/ffi/api/c_api.h`, the binary interface is stable within
its major version 0): the addresses of the buffers of its arguments and results, with their extents. All fields are
eight bytes wide or padded to it, so that the frame is read as an array of 64-bit words.
"""

import ctypes
import threading
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, no_type_check

import jax
import numba
import numpy as np
from numba import types
from numba.extending import intrinsic

# Not-a-number marks what has no solution, so that neither it nor infinity may be reasoned away.
FLAGS = {"nsz", "contract"}


# Only what XLA calls is kept on disk and can be called from outside; all that it calls is compiled into it.
_INNER: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
compiled = numba.njit(fastmath=FLAGS, error_model="numpy", nogil=True, **_INNER)

_FRAME_WORDS, _EXTENSION, ARGUMENTS, RESULTS = 22, 1, 9, 14
_BUFFER_WORDS, _DATA, _RANK, _EXTENTS = 6, 3, 4, 5
_METADATA = 1  # the extension by which XLA asks which interface a function speaks
_VERSION = 6  # words of 32 bits in the metadata: major and minor version, traits


@intrinsic
@no_type_check
def _pointer(typing, address, dtype):
    """The address as a pointer to numbers of a type."""
    signature = types.CPointer(dtype.dtype)(address, dtype)
    return signature, lambda context, builder, s, a: builder.inttoptr(a[0], context.get_value_type(s.return_type))


@compiled
@no_type_check
def words(address, count):
    """64-bit words from an address on."""
    return numba.carray(_pointer(address, np.int64), (count,))


@compiled
@no_type_check
def buffers(frame, where, count):
    """The buffers of the arguments (`where` is ARGUMENTS) or results (RESULTS), a row each."""
    table = np.empty((count, _BUFFER_WORDS), np.int64)
    for n in range(count):
        copy(words(words(frame[where], count)[n], _BUFFER_WORDS), table[n])
    return table


@compiled
@no_type_check
def extents(buffer):
    """(height, width)."""
    size = words(buffer[_EXTENTS], 2)
    return size[0], size[1]


@compiled
@no_type_check
def image(buffer, dtype):
    """A buffer of rank 2."""
    return numba.carray(_pointer(buffer[_DATA], dtype), extents(buffer))


@compiled
@no_type_check
def vector(buffer, count, dtype):
    """The first numbers of a buffer."""
    return numba.carray(_pointer(buffer[_DATA], dtype), (count,))


@compiled
@no_type_check
def image_or_number(buffer, width, dtype):
    """A buffer of rank 2, or one of rank 0 as a single row."""
    if buffer[_RANK] == 2:
        return image(buffer, dtype)
    row = np.empty((1, width), dtype)
    row[0, :] = vector(buffer, 1, dtype)[0]
    return row


@compiled
@no_type_check
def is_question(frame):
    """Whether XLA asks for the interface instead of calling; the answer is written where it wants it."""
    if frame[_EXTENSION] == 0:
        return False
    extension = words(frame[_EXTENSION], 4)
    if np.int32(extension[1]) != _METADATA:
        return False
    metadata = numba.carray(_pointer(extension[3], np.int32), (_VERSION + 3,))
    metadata[_VERSION], metadata[_VERSION + 1], metadata[_VERSION + 2] = 0, 1, 0
    return True


@compiled
@no_type_check
def call_frame(address):
    """The call frame that XLA passes."""
    return numba.carray(address, (_FRAME_WORDS,))


@compiled
@no_type_check
def copy(source, target):
    """Of a vector. (An assignment to a slice brings its error messages with it, half a minute of compilation.)"""
    for j in range(source.shape[0]):
        target[j] = source[j]


@compiled
@no_type_check
def turn(source, target):
    """target[j, i] = source[i, j], by squares that stay in the cache."""
    height, width = source.shape
    # a cache keeps no more than eight lines that are a power of two apart
    side = max(8, 32 // source.itemsize)
    for top in range(0, height, side):
        for left in range(0, width, side):
            square = source[top : top + side, left : left + side]
            turned = target[left : left + side, top : top + side]
            for j in range(square.shape[1]):
                column, row = square[:, j], turned[j]
                for i in range(column.shape[0]):
                    row[i] = column[i]


@compiled
@no_type_check
def swept_copy(x, shape, columns):
    """x, with columns for rows where sweeps go over the columns."""
    swept = np.empty(shape, x.dtype)
    if columns:
        turn(x, swept)
    else:
        for i in range(x.shape[0]):
            copy(x[i], swept[i])
    return swept


@compiled
@no_type_check
def put_back(swept, target, columns):
    """The inverse of `swept_copy`."""
    if columns:
        turn(swept, target)
    else:
        for i in range(swept.shape[0]):
            copy(swept[i], target[i])


_REGISTERING = threading.Lock()


def registered(name: str, make: Callable[..., Callable[..., int]], real: type) -> str:
    """`name`, under which XLA knows the function of a call frame that `make`(real, version) gives and Numba compiles
    here, once a process whatever the number of threads that ask: XLA takes a name once.

    Numba keeps what it compiled by the function alone, not by what that calls: hence the version, a cell of it.
    """
    with _REGISTERING:
        return _registered(name, make, real)


@cache
def _registered(name: str, make: Callable[..., Callable[..., int]], real: type) -> str:
    native = _kept(types.int64(types.CPointer(types.int64)), make(real, _version_of_sources()))
    jax.ffi.register_ffi_target(name, _capsule(native.address), platform="cpu")
    return name


@cache
def _version_of_sources() -> int:
    """A number, not 0, that changes with any file of this package."""
    sources = (path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
    return 1 + zlib.crc32(b"".join(sources))


def _kept(signature, function: Callable[..., int]):
    """The function compiled, and kept for later processes where there is a folder for that."""
    try:
        return numba.cfunc(signature, cache=True)(function)
    except RuntimeError:  # neither the package's folder nor the user's can be written to
        return numba.cfunc(signature)(function)


def _capsule(address: int | None):
    make = ctypes.pythonapi.PyCapsule_New
    make.restype, make.argtypes = ctypes.py_object, (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
    return make(address, None, None)
