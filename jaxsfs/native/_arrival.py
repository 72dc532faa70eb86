"""Sweeps over the rows or columns for arrival times: `jaxsfs.arrival._rows._row_update`, a row in one loop."""

import math
from typing import no_type_check

import numpy as np

from jaxsfs.native import BLOCK
from jaxsfs.native._blocks import block_count, mark_changed, mark_near, mark_owned, next_run
from jaxsfs.native._kernel import compiled, copy
from jaxsfs.native._numbers import HALF, HUGE, ONE, PAD, QUARTER, TWO, ZERO, limited_difference


@compiled
@no_type_check
def _smooth(near, far):
    """(a, b) of `jaxsfs.arrival._rows._smooth`."""
    exists = far < HALF * HUGE
    return ONE + (HALF if exists else ZERO), HALF * (near - far) if exists else ZERO


@compiled
@no_type_check
def _from_triangle(straight, diagonal, p0, c0, p1, c1, slowness, root2):
    """The value from between both neighbours, or along one of the edges to them."""
    along = diagonal + (root2 * slowness + c1) / p1
    edge = straight + (slowness + c0) / p0
    edge = edge if edge < along else along
    c1 = c1 + p1 * (diagonal - straight)
    e, k = p0 - p1, c1 - c0
    quad, half = p0 * p0 + e * e, p0 * c0 - e * k
    x = (half + math.sqrt(half * half - quad * (c0 * c0 + k * k - slowness * slowness))) / quad
    turn, d0 = e * x + k, p0 * x - c0
    return straight + x if (turn <= ZERO) & (turn + d0 >= ZERO) else edge


@compiled
@no_type_check
def _first_order(v, lines, slowness, root2):
    """A row in place; nothing has a factor."""
    n = v.shape[0]
    here, straight = lines[0][PAD : n + PAD], lines[1][PAD : n + PAD]
    left, right = lines[1][PAD - 1 : n + PAD - 1], lines[1][PAD + 1 : n + PAD + 1]
    for j in range(n):
        old, m, on_left, on_right, s = here[j], straight[j], left[j], right[j], slowness[j]
        diagonal = on_left if on_left < on_right else on_right
        gap = diagonal - m
        x = math.sqrt(s * s - gap * gap)
        along, edge = diagonal + root2 * s, m + s
        edge = edge if edge < along else along
        new = m + x if (gap <= ZERO) & (gap + x >= ZERO) else edge
        v[j] = new if new < old else old


@compiled
@no_type_check
def _second_order(v, lines, slowness, owners, bits, root2, slack):
    """A row in place: the first owner sets a pixel anew, the others lower it, and who owns nothing only by `slack` of
    its slowness."""
    n = v.shape[0]
    here, straight, after = lines[0][PAD : n + PAD], lines[1][PAD : n + PAD], lines[2][PAD : n + PAD]
    left, right = lines[1][PAD - 1 : n + PAD - 1], lines[1][PAD + 1 : n + PAD + 1]
    far_left, far_right = lines[2][0:n], lines[2][2 * PAD : n + 2 * PAD]
    for j in range(n):
        old, m, m1, on_left, on_right, s = here[j], straight[j], after[j], left[j], right[j], slowness[j]
        m_left, m_right, own = far_left[j], far_right[j], owners[j]
        from_left = on_right - on_left > ZERO
        diagonal = on_left if from_left else on_right
        a0, b0 = limited_difference(old, m, m1, HALF)
        a1, b1 = limited_difference(old, diagonal, m_left if from_left else m_right, HALF)
        new = _from_triangle(m, diagonal, a0, b0, a1, b1, s, root2)
        owns, first = (own & bits[0]) != 0, (own & bits[1]) != 0
        better = new < (old if owns else old - slack * s)
        v[j] = new if better | first else old


@compiled
@no_type_check
def _with_factor(v, lines, slowness, owners, across, along, bits, root2, sign, second, slack):
    """A row in place with a factor T₀ (`jaxsfs.arrival._rows.Factor`), of first or second order."""
    n = v.shape[0]
    here, straight, after = lines[0][PAD : n + PAD], lines[1][PAD : n + PAD], lines[2][PAD : n + PAD]
    left, right = lines[1][PAD - 1 : n + PAD - 1], lines[1][PAD + 1 : n + PAD + 1]
    far_left, far_right = lines[2][0:n], lines[2][2 * PAD : n + 2 * PAD]
    for j in range(n):
        old, m, m1, on_left, on_right, s = here[j], straight[j], after[j], left[j], right[j], slowness[j]
        m_left, m_right, own, fall, side = far_left[j], far_right[j], owners[j], sign * across[j], along[j]
        from_left = on_right - on_left + TWO * side * m > ZERO
        diagonal = on_left if from_left else on_right
        a0, b0 = _smooth(m, m1 if second else HUGE)
        a1, b1 = _smooth(diagonal, (m_left if from_left else m_right) if second else HUGE)
        slope = fall + (side if from_left else -side)
        a0, b0, a1, b1 = a0 + fall, b0 - fall * m, a1 + slope, b1 - slope * diagonal
        new = _from_triangle(m, diagonal, a0, b0, a1, b1, s, root2)
        owns, first = ((own & bits[0]) != 0) | (not second), (own & bits[1]) != 0
        better = new < (old if owns else old - slack * s)
        v[j] = new if better | first else old


@compiled
@no_type_check
def _updated(v, lines, slowness, owners, across, along, nth, second, factored, frozen):
    """A row in place, by the sweep that is the `nth` of a round."""
    real = slowness.dtype.type
    root2, sign = real(math.sqrt(2)), real(1 - 2 * (nth % 2))
    bits, slack = (np.uint8(1 << nth), np.uint8(16 << nth)), real(HUGE) if frozen else real(QUARTER)
    if factored:
        _with_factor(v, lines, slowness, owners, across, along, bits, root2, sign, second, slack)
    elif second:
        _second_order(v, lines, slowness, owners, bits, root2, slack)
    else:
        _first_order(v, lines, slowness, root2)


@compiled
@no_type_check
def sweep(v, slowness, owners, factor, squares, nth, second, factored, frozen):
    """A sweep down (even `nth`) or up the rows, in place. Of what is the same everywhere there is one row.

    Left out is where nothing would change: in first order blocks near which nothing did since sweeps of this way came
    by last (`squares` of blocks: the awake ones, where something did, and the changed ones, where these sweeps did it);
    in second order, while owners are `frozen`, blocks without pixels of its own.
    """
    (across, along), (awake, changed) = factor, squares
    height, width = v.shape
    step = 1 if nth % 2 == 0 else -1
    lines = np.full((3, width + 2 * PAD), v.dtype.type(HUGE))
    live = np.ones(block_count(width), np.uint8)
    for n in range(height):
        i = n if step > 0 else height - 1 - n
        here, before, beyond = lines[n % 3], lines[(n + 2) % 3], lines[(n + 1) % 3]
        copy(v[i], here[PAD : width + PAD])
        if frozen:
            mark_owned(live, owners[i % owners.shape[0]], np.uint8(17 << nth))
        elif not second:
            mark_near(live, awake[max(min(i - step, height - 1), 0) // BLOCK])
        begin, end, a, b = next_run(live, 0, width)
        if begin == end:
            continue
        while begin < end:
            margin = slice(a, b + 2 * PAD)
            rows = here[margin], before[margin], beyond[margin]
            local = across[i % across.shape[0], a:b], along[i % along.shape[0], a:b]
            part = v[i, a:b], rows, slowness[i, a:b], owners[i % owners.shape[0], a:b]
            _updated(*part, *local, nth, second, factored, frozen)
            begin, end, a, b = next_run(live, end, width)
        mark_changed(changed[i // BLOCK], awake[i // BLOCK], v[i], here[PAD : width + PAD])
        copy(v[i], here[PAD : width + PAD])


@compiled
@no_type_check
def offers_of(v, offers, slowness, factor, nth, factored):
    """What each pixel is offered in first order from the row before it, v as it is: less than a row without data."""
    across, along = factor
    height, width = v.shape
    step = 1 if nth % 2 == 0 else -1
    nobody = np.zeros(width, np.uint8)
    lines = np.full((2, width + 2 * PAD), v.dtype.type(HUGE))
    for i in range(height):
        offers[i, :] = v.dtype.type(HUGE)
        if 0 <= i - step < height:
            copy(v[i - step], lines[1, PAD : width + PAD])
            local = across[i % across.shape[0]], along[i % along.shape[0]]
            rows = lines[0], lines[1], lines[0]
            _updated(offers[i], rows, slowness[i], nobody, local[0], local[1], nth, False, factored, False)
