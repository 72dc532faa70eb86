"""Rounds of sweeps for arrival times, and who owns which pixel, as functions that XLA calls."""

from typing import no_type_check

import numpy as np

from jaxsfs.native._arrival import offers_of, sweep
from jaxsfs.native._blocks import clear
from jaxsfs.native._kernel import (
    ARGUMENTS,
    RESULTS,
    buffers,
    call_frame,
    compiled,
    image,
    image_or_number,
    is_question,
    put_back,
    swept_copy,
    turn,
    vector,
)
from jaxsfs.native._numbers import HALF, HUGE, ZERO

TIE = np.float32(0.1)  # as in `jaxsfs.arrival._rows`


@compiled
@no_type_check
def _largest(v, other):
    """The largest |v|, or `other` if that is larger, of a row, but for what no front reached."""
    largest = other
    for j in range(v.shape[0]):
        size = abs(v[j]) if v[j] < HALF * HUGE else ZERO
        largest = size if size > largest else largest
    return largest


@compiled
@no_type_check
def _difference(new, old, most):
    """Sum of |new − old| of a row, each at most `most`."""
    total = new.dtype.type(0)
    for j in range(new.shape[0]):
        gap = abs(new[j] - old[j])
        total += gap if gap < most else most
    return total


@compiled
@no_type_check
def _mean_change(new, old):
    """Mean of |new − old| in units of the largest value; what a front reached first counts as that."""
    size = new.dtype.type(1e-30)
    for i in range(new.shape[0]):
        size = _largest(new[i], size)
    total = 0.0
    for i in range(new.shape[0]):
        total += _difference(new[i], old[i], size)
    return total / (size * new.size)


@compiled
@no_type_check
def _awake(own, other):
    """Blocks that changed under the sweeps of this way when they came by last, or under the others since."""
    awake = np.empty(own.shape, np.uint8)
    for i in range(own.shape[0]):
        for j in range(own.shape[1]):
            awake[i, j] = own[i, j] | other[j, i]
    return awake


@compiled
@no_type_check
def _fields(given, width, real):
    """Slowness, and the factor across and along the rows."""
    return image(given[0], real), (image_or_number(given[1], width, real), image_or_number(given[2], width, real))


@compiled
@no_type_check
def _half_round(v, given, other_changed, changed, flags, columns, real):
    """Sweeps there and back over the rows of v, which are columns of the picture for the second half."""
    slowness, factor = _fields(given, v.shape[1], real)
    owners = image_or_number(given[3], v.shape[1], np.uint8)
    squares = _awake(image(given[4], np.uint8), other_changed), changed
    for i in range(changed.shape[0]):
        clear(changed[i])
    for nth in range(2 * columns, 2 * columns + 2):
        sweep(v, slowness, owners, factor, squares, nth, flags[0] != 0, flags[1] != 0, flags[2] != 0)


@compiled
@no_type_check
def _round_called(address, real):
    """One call by XLA: arguments and results as `jaxsfs.arrival._numba` lists them."""
    frame = call_frame(address)
    if is_question(frame):
        return 0
    given, wanted = buffers(frame, ARGUMENTS, 12), buffers(frame, RESULTS, 4)
    old, flags = image(given[0], real), vector(given[1], 3, np.int8)
    by_rows, by_columns = image(wanted[1], np.uint8), image(wanted[2], np.uint8)
    v = swept_copy(old, old.shape, False)
    _half_round(v, given[2:7], image(given[11], np.uint8), by_rows, flags, 0, real)
    turned = swept_copy(v, (v.shape[1], v.shape[0]), True)
    _half_round(turned, given[7:12], by_rows, by_columns, flags, 1, real)
    new = image(wanted[0], real)
    put_back(turned, new, True)
    vector(wanted[3], 1, real)[0] = _mean_change(new, old)
    return 0


@compiled
@no_type_check
def _own(offers, slowness, owners, i, real):
    """Owners of a row: `jaxsfs.arrival._rows.owners`."""
    first, second, third, fourth = offers[0, i], offers[1, i], offers[2, i], offers[3, i]
    row, slow = owners[i], slowness[i]
    for j in range(row.shape[0]):
        a, b, c, d = first[j], second[j], third[j], fourth[j]
        least = min(min(a, b), min(c, d))
        most = min(least + TIE * slow[j], HALF * HUGE)
        # the first owner last, so that the first of several counts
        bits, best = np.uint8(8 * (d <= most)), np.uint8(128)
        bits, best = bits | np.uint8(4 * (c <= most)), np.uint8(64) if c == least else best
        bits, best = bits | np.uint8(2 * (b <= most)), np.uint8(32) if b == least else best
        bits, best = bits | np.uint8(a <= most), np.uint8(16) if a == least else best
        row[j] = bits | (best if bits != 0 else np.uint8(0))


@compiled
@no_type_check
def _owners_called(address, real):
    """The same for owners, and once more with columns for rows."""
    frame = call_frame(address)
    if is_question(frame):
        return 0
    given, wanted = buffers(frame, ARGUMENTS, 8), buffers(frame, RESULTS, 2)
    v, factored = image(given[0], real), vector(given[1], 1, np.int8)[0] != 0
    height, width = v.shape
    offers = np.empty((4, height, width), real)
    turned, offered = swept_copy(v, (width, height), True), np.empty((width, height), real)
    by_rows, by_columns = _fields(given[2:5], width, real), _fields(given[5:8], height, real)
    for n in range(2):
        offers_of(v, offers[n], by_rows[0], by_rows[1], n, factored)
        offers_of(turned, offered, by_columns[0], by_columns[1], 2 + n, factored)
        turn(offered, offers[2 + n])
    owners = image(wanted[0], np.uint8)
    for i in range(height):
        _own(offers, by_rows[0], owners, i, real)
    turn(owners, image(wanted[1], np.uint8))
    return 0


@no_type_check
def rounds(real, version):
    """Four sweeps over an image of `real` numbers. See `target_for`."""

    @no_type_check
    def called(address):
        return _round_called(address, real) if version else 1

    return called


@no_type_check
def owners(real, version):
    """Who offers each pixel of an image of `real` numbers the least. See `target_for`."""

    @no_type_check
    def called(address):
        return _owners_called(address, real) if version else 1

    return called
