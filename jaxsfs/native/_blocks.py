"""Which parts of a row a sweep has to look at: blocks of BLOCK pixels, so that what is left is still long vectors."""

from typing import no_type_check

import numpy as np

from jaxsfs.native import BLOCK
from jaxsfs.native._kernel import compiled


@compiled
@no_type_check
def block_count(width):
    """Blocks of a row; the last one may be shorter."""
    return (width + BLOCK - 1) // BLOCK


@compiled
@no_type_check
def _pixels(row, block):
    """Those of a block."""
    return row[block * BLOCK : min((block + 1) * BLOCK, row.shape[0])]


@compiled
@no_type_check
def next_run(live, begin, width):
    """The next run of `live` blocks from block `begin` on: its first block, the block after it, its first pixel and the
    pixel after it. Both blocks are the same where none is left."""
    while begin < live.shape[0] and live[begin] == 0:
        begin += 1
    end = begin
    while end < live.shape[0] and live[end] != 0:
        end += 1
    return begin, end, begin * BLOCK, min(end * BLOCK, width)


@compiled
@no_type_check
def clear(blocks):
    """No block is in the set."""
    for block in range(blocks.shape[0]):
        blocks[block] = 0


@compiled
@no_type_check
def mark_owned(live, owners, bits):
    """Blocks in which a pixel has an owner among `bits`."""
    for block in range(live.shape[0]):
        some, found = _pixels(owners, block), np.uint8(0)
        for j in range(some.shape[0]):
            found |= some[j]
        live[block] = found & bits


@compiled
@no_type_check
def mark_owned_by(live, owners, direction):
    """Blocks in which a pixel is owned by the sweep `direction`."""
    for block in range(live.shape[0]):
        some, found = _pixels(owners, block), np.uint8(0)
        for j in range(some.shape[0]):
            found |= np.uint8(some[j] == direction)
        live[block] = found


@compiled
@no_type_check
def mark_near(live, awake):
    """Blocks that are `awake` or next to such a one."""
    last = live.shape[0] - 1
    for block in range(live.shape[0]):
        live[block] = awake[max(block - 1, 0)] | awake[block] | awake[min(block + 1, last)]


@compiled
@no_type_check
def mark_changed(changed, awake, new, old):
    """Adds to both sets the blocks of a row in which `new` is not `old`."""
    for block in range(changed.shape[0]):
        one, other, found = _pixels(new, block), _pixels(old, block), np.uint8(0)
        for j in range(one.shape[0]):
            found |= np.uint8(one[j] != other[j])
        changed[block] |= found
        awake[block] |= found
