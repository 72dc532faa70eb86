"""Sweeps over the rows or columns of the static form: `jaxsfs.updates._rows`, a row in one loop."""

import math
from typing import no_type_check

import numpy as np

from jaxsfs.native._blocks import block_count, mark_owned_by, next_run
from jaxsfs.native._kernel import (
    ARGUMENTS,
    RESULTS,
    buffers,
    call_frame,
    compiled,
    copy,
    image,
    image_or_number,
    is_question,
    put_back,
    swept_copy,
    vector,
)
from jaxsfs.native._numbers import HALF, HUGE, PAD, TWO, ZERO, limited_difference


@compiled
@no_type_check
def _lower_edge(best, m, a, b, determinant, h, constant, linear, square):
    """`best`, or what comes along an edge where that is less."""
    slope, left = square * m + HALF * linear, constant - m * (square * m + linear)
    scaled = determinant * a
    quad, half = scaled * a + h * square, scaled * b - h * slope
    rest = determinant * b * b - h * left
    v = m + (half + math.sqrt(half * half - quad * rest)) / quad
    return v if (v >= m) & (v < best) else best


@compiled
@no_type_check
def _row(v, owner, scratch, lines, metric, balance, top, free, direction, way):
    """New values of a row in place: `jaxsfs.updates._pixel.offered` and `taken`, pixel by pixel.

    `lines`: this row as it was and the two that were swept before it, each with a margin of two pixels; `way`: the sign
    of g₁₂, ½ for second order and 0 for first, and what an offer must be better by. Slices of one length make the loop
    one of vector operations.
    """
    (sign, second, better), (g11, g12, g22), (constant, linear, square) = way, metric, balance
    n = v.shape[0]
    here, straight, after = lines[0][PAD : n + PAD], lines[1][PAD : n + PAD], lines[2][PAD : n + PAD]
    left, right = lines[1][PAD - 1 : n + PAD - 1], lines[1][PAD + 1 : n + PAD + 1]
    far_left, far_right = lines[2][0:n], lines[2][2 * PAD : n + 2 * PAD]
    side, mixed, slope1, drop1, slope2, drop2 = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4], scratch[5]
    # two loops, since a processor overlaps the steps of two short chains of operations, not those of a long one
    for j in range(n):
        old, m1, on_left, on_right, m11 = here[j], straight[j], left[j], right[j], after[j]
        m_left, m_right, a11, a12, a22 = far_left[j], far_right[j], g11[j], sign * g12[j], g22[j]
        room = constant[j] - m1 * (square[j] * m1 + linear[j])
        # right − left < −2 g₁₂ √(room/(g₁₁ |g|)), squared with its signs
        rise, skew = on_right - on_left, -TWO * a12
        bounded = room if room > ZERO else ZERO
        from_right = rise * abs(rise) * (a11 * (a11 * a22 - a12 * a12)) < skew * abs(skew) * bounded
        m2 = on_right if from_right else on_left
        a1, b1 = limited_difference(old, m1, m11, second)
        a2, b2 = limited_difference(old, m2, m_right if from_right else m_left, second)
        side[j], mixed[j] = m2, a12 if from_right else -a12
        slope1[j], drop1[j], slope2[j], drop2[j] = a1, b1, a2, b2
    for j in range(n):
        old, m1, m2, a1, b1, a2, b2 = here[j], straight[j], side[j], slope1[j], drop1[j], slope2[j], drop2[j]
        a11, a12, a22, c0, c1, c2 = g11[j], mixed[j], g22[j], constant[j], linear[j], square[j]
        limit, own, may = top[j], owner[j], free[j]
        determinant = a11 * a22 - a12 * a12
        best = _lower_edge(HUGE, m1, a1, b1, determinant, a11, c0, c1, c2)
        best = _lower_edge(best, m2, a2, b2, determinant, a11 + TWO * a12 + a22, c0, c1, c2)
        a, b = a1 - a2, b1 - b2 - a2 * (m2 - m1)
        across, along = a22 * a1 + a12 * a, a12 * a1 + a11 * a
        quad = a1 * across + a * along + c2
        half = b1 * across + b * along - (c2 * m1 + HALF * c1)
        rest = b1 * (a22 * b1 + TWO * a12 * b) + a11 * b * b - (c0 - m1 * (c2 * m1 + c1))
        x = (half + math.sqrt(half * half - quad * rest)) / quad
        p1, p2 = a1 * x - b1, a * x - b
        aside = a12 * p1 + a11 * p2
        between = (aside <= ZERO) & (a22 * p1 + a12 * p2 + aside >= ZERO) & (p1 >= ZERO) & (p1 >= p2)
        offer = m1 + x if between & (m1 + x < best) else best
        takes = (may != 0) & ((offer < old - better) | (own == direction))
        offer = offer if offer < limit else limit
        v[j] = offer if takes else old
    # by itself: with a second result the first loop would not become one of vector operations
    for j in range(n):
        owner[j] = direction if v[j] < here[j] else owner[j]


@compiled
@no_type_check
def _sweep(v, owner, metric, balance, top, free, direction, forward, way, frozen):
    """A sweep down (`forward`) or up the rows, in place. Of what is the same everywhere there is one row. While owners
    are `frozen` only blocks with pixels of its own are looked at: nothing else would change."""
    (g11, g12, g22), (constant, linear, square) = metric, balance
    height, width = v.shape
    lines = np.full((3, width + 2 * PAD), v.dtype.type(HUGE))
    scratch = np.empty((6, width), v.dtype)
    live = np.ones(block_count(width), np.uint8)
    for n in range(height):
        i = n if forward else height - 1 - n
        here, before, beyond = lines[n % 3], lines[(n + 2) % 3], lines[(n + 1) % 3]
        copy(v[i], here[PAD : width + PAD])
        coefficients = constant[i % constant.shape[0]], linear[i % linear.shape[0]], square[i % square.shape[0]]
        if frozen:
            mark_owned_by(live, owner[i], direction)
        begin, end, a, b = next_run(live, 0, width)
        while begin < end:
            margin = slice(a, b + 2 * PAD)
            _row(
                v[i, a:b],
                owner[i, a:b],
                scratch,
                (here[margin], before[margin], beyond[margin]),
                (g11[i, a:b], g12[i, a:b], g22[i, a:b]),
                (coefficients[0][a:b], coefficients[1][a:b], coefficients[2][a:b]),
                top[i, a:b],
                free[i, a:b],
                direction,
                way,
            )
            begin, end, a, b = next_run(live, end, width)
        copy(v[i], here[PAD : width + PAD])


@compiled
@no_type_check
def _called(address, real):
    """One call by XLA: arguments and results as `jaxsfs.updates._numba` lists them."""
    frame = call_frame(address)
    if is_question(frame):
        return 0
    given, wanted = buffers(frame, ARGUMENTS, 11), buffers(frame, RESULTS, 2)
    v, owner = image(given[0], real), image(given[1], np.int8)
    metric = image(given[2], real), image(given[3], real), image(given[4], real)
    top, free = image(given[5], real), image(given[6], np.bool_)
    width = top.shape[1]
    constant, linear = image_or_number(given[7], width, real), image_or_number(given[8], width, real)
    balance = constant, linear, image_or_number(given[9], width, real)
    flags = vector(given[10], 3, np.int8)
    columns, second, frozen = flags[0], real(0.5 if flags[1] else 0), flags[2] != 0
    swept, swept_owner = swept_copy(v, top.shape, columns), swept_copy(owner, top.shape, columns)
    for forward in (True, False):
        way, direction = (
            (real(1 if forward else -1), second, real(4e30 if frozen else 0)),
            np.int8(2 * columns + forward),
        )
        _sweep(swept, swept_owner, metric, balance, top, free, direction, forward, way, frozen)
    put_back(swept, image(wanted[0], real), columns)
    put_back(swept_owner, image(wanted[1], np.int8), columns)
    return 0


@no_type_check
def sweeps(real, version):
    """Both sweeps over the rows or columns of images of `real` numbers. See `target_for`."""

    @no_type_check
    def called(address):
        return _called(address, real) if version else 1

    return called
