"""Sweeps over the rows or columns of the causal linear system and its transpose: `jaxsfs.implicit._rows`, a row in one
loop."""

from typing import no_type_check

import numpy as np

from jaxsfs.native._kernel import (
    ARGUMENTS,
    RESULTS,
    buffers,
    call_frame,
    compiled,
    copy,
    image,
    is_question,
    put_back,
    swept_copy,
    vector,
)
from jaxsfs.native._numbers import PAD, ZERO


@compiled
@no_type_check
def _pulled(x, b, weights, owner, me, before, beyond):
    """A row of x = b + C x in place, where it belongs to the sweep `me`."""
    n = x.shape[0]
    straight, left, right = before[PAD : n + PAD], before[PAD - 1 : n + PAD - 1], before[PAD + 1 : n + PAD + 1]
    far_straight, far_left, far_right = beyond[PAD : n + PAD], beyond[0:n], beyond[2 * PAD : n + 2 * PAD]
    w0, w1, w2, w3, w4, w5 = weights
    for j in range(n):
        near = w0[j] * straight[j] + w1[j] * left[j] + w2[j] * right[j]
        far = w3[j] * far_straight[j] + w4[j] * far_left[j] + w5[j] * far_right[j]
        x[j] = b[j] + near + far if owner[j] == me else x[j]


@compiled
@no_type_check
def _pull(x, b, weights, owner, forward):
    """A sweep down (`forward`) or up the rows, in place; `weights` of the six pixels that are read, one below the
    other."""
    height, width = x.shape
    lines = np.zeros((3, width + 2 * PAD), x.dtype)
    for n in range(height):
        i = n if forward else height - 1 - n
        at = _stacked(weights, height, i)
        _pulled(x[i], b[i], at, owner[i], np.int8(forward), lines[(n + 2) % 3], lines[(n + 1) % 3])
        copy(x[i], lines[n % 3, PAD : width + PAD])


@compiled
@no_type_check
def _stacked(weights, height, i):
    """Row i of each of six images that lie one below the other."""
    return (
        weights[i],
        weights[height + i],
        weights[2 * height + i],
        weights[3 * height + i],
        weights[4 * height + i],
        weights[5 * height + i],
    )


@compiled
@no_type_check
def _pushed(total, waiting, weights, owner, me, near, far, handed):
    """A row of Cᵀ in place: what came (`near` from the row before, `far` from the one before that) is handed on, times
    the weights of those that are read, where it belongs to the sweep `me`."""
    n = total.shape[0]
    straight, left, right = near[0][PAD : n + PAD], near[1][PAD + 1 : n + PAD + 1], near[2][PAD - 1 : n + PAD - 1]
    far_straight, far_left, far_right = far[3][PAD : n + PAD], far[4][2 * PAD : n + 2 * PAD], far[5][0:n]
    value = np.empty(n, total.dtype)
    for j in range(n):
        value[j] = waiting[j] + straight[j] + left[j] + right[j] + far_straight[j] + far_left[j] + far_right[j]
    for k in range(6):
        weight, line = weights[k], handed[k, PAD : n + PAD]
        for j in range(n):
            line[j] = weight[j] * value[j] if owner[j] == me else ZERO
    for j in range(n):
        total[j] += value[j] if owner[j] == me else ZERO
        waiting[j] = ZERO if owner[j] == me else value[j]


@compiled
@no_type_check
def _push(total, waiting, weights, owner, forward):
    """A sweep of Cᵀ against the order of `_pull`, in place."""
    height, width = total.shape
    lines = np.zeros((3, 6, width + 2 * PAD), total.dtype)
    for n in range(height):
        i = height - 1 - n if forward else n
        at = _stacked(weights, height, i)
        near, far = lines[(n + 2) % 3], lines[(n + 1) % 3]
        _pushed(total[i], waiting[i], at, owner[i], np.int8(forward), near, far, lines[n % 3])


@compiled
@no_type_check
def _pulls_called(address, real):
    """One call by XLA: arguments and result as `jaxsfs.implicit._numba` lists them."""
    frame = call_frame(address)
    if is_question(frame):
        return 0
    given, wanted = buffers(frame, ARGUMENTS, 5), buffers(frame, RESULTS, 1)
    x, b, weights = image(given[0], real), image(given[1], real), image(given[2], real)
    owner, columns = image(given[3], np.int8), vector(given[4], 1, np.int8)[0] != 0
    swept = swept_copy(x, owner.shape, columns)
    turned = swept_copy(b, owner.shape, columns)
    for forward in (True, False):
        _pull(swept, turned, weights, owner, forward)
    put_back(swept, image(wanted[0], real), columns)
    return 0


@compiled
@no_type_check
def _pushes_called(address, real):
    """The same for the transpose."""
    frame = call_frame(address)
    if is_question(frame):
        return 0
    given, wanted = buffers(frame, ARGUMENTS, 5), buffers(frame, RESULTS, 2)
    total, waiting, weights = image(given[0], real), image(given[1], real), image(given[2], real)
    owner, columns = image(given[3], np.int8), vector(given[4], 1, np.int8)[0] != 0
    sums, rest = swept_copy(total, owner.shape, columns), swept_copy(waiting, owner.shape, columns)
    for forward in (False, True):
        _push(sums, rest, weights, owner, forward)
    put_back(sums, image(wanted[0], real), columns)
    put_back(rest, image(wanted[1], real), columns)
    return 0


@no_type_check
def pulls(real, version):
    """Both sweeps over the rows or columns of images of `real` numbers. See `target_for`."""

    @no_type_check
    def called(address):
        return _pulls_called(address, real) if version else 1

    return called


@no_type_check
def pushes(real, version):
    """The same for the transpose. See `target_for`."""

    @no_type_check
    def called(address):
        return _pushes_called(address, real) if version else 1

    return called
