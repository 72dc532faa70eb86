"""Numbers and the difference that the sweeps share. The numbers are exact in every type, and take that of what they are
combined with."""

from typing import no_type_check

import numpy as np

from jaxsfs.native._kernel import compiled

ZERO, QUARTER, HALF, ONE, TWO, FOUR = (np.float32(x) for x in (0, 0.25, 0.5, 1, 2, 4))
HUGE = np.float32(1e30)
PAD = 2  # pixels beyond a row that second order reads


@compiled
@no_type_check
def limited_difference(here, near, far, second):
    """(a, b) of the one-sided difference a (v − near) − b of `jaxsfs.updates._pixel` and `jaxsfs.arrival._rows`;
    `second` is ½, or 0 for first order."""
    fall, before = here - near, near - far
    ratio = before / fall
    share = min(FOUR * ratio - ONE, TWO - HALF * ratio)
    share = share if share > ZERO else ZERO
    share = share if share < ONE else ONE
    share = second * share if fall > ZERO else ZERO
    return ONE + share, share * before
